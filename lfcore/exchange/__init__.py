"""Import and export of other programs' light fields: one module per format, and their table.

``import_lightfield(source, "lf.mkv")`` and ``export_lightfield("lf.mkv", "hci", folder)``.
"""
