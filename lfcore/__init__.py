"""Synthetic light fields: trace a light slab, store it, refocus it, measure it.

    import lfcore

    scene = lfcore.load_scene("model.glb")
    picture = lfcore.render(scene, focus_m=3.2, f_number=2)
    field = lfcore.record(scene, "model.mkv", views=32, pixels=512, f_number=2)
    near = field.refocus(focus_m=2.0)

Everything public is named in ``__init__.pyi`` and imported when it is first used: ``import lfcore``
alone loads no driver.  docs/architecture.md lists the packages, and which imports which.
"""

import lazy_loader

__version__ = "0.2.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
