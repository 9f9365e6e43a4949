"""Import and export of other programs' light fields: one module per format, and their table.

``import_lightfield(source, "lf.mkv")`` and ``export_lightfield("lf.mkv", "hci", folder)``.
"""

from lfcore.exchange.exporting import export_lightfield
from lfcore.exchange.importing import import_lightfield
from lfcore.exchange.table import FORMATS

__all__ = ["FORMATS", "export_lightfield", "import_lightfield"]
