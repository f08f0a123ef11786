"""Sphinx configuration. Everything is built from this repository; nothing is fetched."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from sphinx.util.inspect import TypeAliasForwardRef
from support import api, docstrings

project = "inclinometry"
author = "the authors of inclinometry"
version = release = "0.1.0"
extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "support.mathml",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "examples", "sg_execution_times.rst", "gallery/sg_execution_times.rst"]

html_math_renderer = "mathml"
html_theme = "furo"
html_show_copyright = False
html_static_path = ["_static"]
html_css_files = ["style.css"]
html_js_files = ["copy.js"]
html_title = "inclinometry"

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "within_subsection_order": "support.style.order",
    "reset_modules": ("support.style.reset",),
    "remove_config_comments": True,
    "capture_repr": (),
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "download_all_examples": False,
}

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
add_module_names = False
autodoc_preserve_defaults = True
# inside a union or a tuple autodoc would print TypeAliasForwardRef('Array')
TypeAliasForwardRef.__repr__ = lambda self: self.name
ALIASES = (
    "Array",
    "ArrayLike",
    "Index",
    "Mask",
    "NDArray",
    "Rows",
    "Sampler",
    "Settings",
    "Severity",
    "Solver",
    "Value",
)
autodoc_type_aliases = {name: name for name in ALIASES}
# types in docstrings are written for people ("(..., 3) array_like"): they are no references
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_custom_sections = [("Fields", "params_style")]
napoleon_google_docstring = False
default_role = "code"
python_use_unqualified_type_names = True

nitpicky = True
# every reference inside the package must resolve; these names of other packages have no page here to point to
OUTSIDE = (
    "Any", "Axes", "Callable", "Collection", "Column", "Figure", "Generator", "Iterable",
    "Iterator", "Mapping", "MappingProxyType", "Markup", "Path", "SeedSequence", "Sequence", "bool_",
    "collections.abc.Callable", "collections.abc.Mapping", "collections.abc.Sequence", "date", "dtype", "float64",
    "floating", "int64", "ndarray", "np.bool_", "numpy.dtype", "numpy.float64", "numpy.int64", "numpy.ndarray",
    "_P", "inclinometry.report.figure._R", "inclinometry.least_squares.State", "CRS", "inclinometry.survey.sag.Shape",
    "inclinometry.calibration.rate_table.Suspect", "complex128", "uint8", "uint32", "datetime", "socket.socket",
    "threading.Event", "sqlalchemy.engine.base.Connection", "sqlalchemy.engine.base.Engine",
    "timedelta", "inclinometry.laboratory.registry.T", "inclinometry.motion.window_filter.Step",
    "inclinometry.position.propagation._Part", "MethodName", "Read", "np.int64", "intp", "np.intp", "hashlib._Hash",
    "Certificate", "Ed25519PrivateKey", "io.BufferedReader", "inclinometry.workflow.well_runs.Run",
    "Progress", "Numbered", "types.Callable", "dataclasses.Field",
    "inclinometry.files.frame.Frame", "inclinometry.files._quantities.Quantity",
    "inclinometry.calibration._field_model.Shots", "inclinometry.calibration._field_model.Unknowns",
    "inclinometry.calibration._field_model.Estimate",
    "pathlib.Path", "types.Path", "datetime.date", "collections.abc.Iterable",
    "numpy.complex128", "np.uint8", "np.uint32", "inclinometry.gyro.tracking._Laid",
)  # fmt: skip
nitpick_ignore = [("py:class", name) for name in (*ALIASES, *OUTSIDE)]
nitpick_ignore += [("py:exc", "tomllib.TOMLDecodeError")]
# three rooms have Stations; inside an alias autodoc leaves the short name, which any of them would answer to
suppress_warnings = ["ref.python"]
nitpick_ignore_regex = [("py:class", r"numpy\._typing\..*"), ("py:class", r"cryptography\..*")]

api.write(HERE / "generated")


def setup(app: object) -> None:
    """Register the reading of docstrings and signatures."""
    app.connect("autodoc-process-docstring", docstrings.prepare, priority=100)
    app.connect("autodoc-process-docstring", docstrings.restore, priority=900)
    app.connect("autodoc-process-signature", docstrings.signature)
