"""Names from hostile logs do not break out of the exported files, by the parsers of their languages."""

import ast
import json
import pathlib
import random
import xml.etree.ElementTree as ElementTree

import pytest
from pylatexenc.latexwalker import LatexWalker

from conftest import ROOT, VESSELS, load, write

ATTACKS = [
    '"""\nimport os\nos.system("touch owned")\n"""',
    "' ; system('touch owned'); %",
    "--> <script>alert(1)</script> <!--",
    "]]> &lt; & <x>",
    "\\end{tabular}\\input{/etc/passwd}",
    "50 % of $x^2$ & \\\\ {#1} ~_",
    "@CLASS@ @NAME@",
    "%{\nblock\n%}",
    "# comment\rline\u2028line",
    "naïve \u202e ψ Δ 船",
    "a--b---",
    "...\nend",
]


def toml(names):
    """A vessel file with names, which begin with numbers: commands have their order. Strings of JSON are strings of TOML."""
    text = (ROOT / "tests/golden/workboat.toml").read_text()
    # Placeholders first, so that names in names are not replaced.
    old = ["workboat", "throttle", "steering", "helm", "bow", "port", "starboard", "tunnel", "drive", "rp", "rs", "rd"]
    for k, name in enumerate(old):
        text = text.replace(f'"{name}"', f"<{k}>")
        if 1 <= k <= 4:
            text = text.replace(f"{{ {name} =", f"{{ <{k}> =").replace(f", {name} =", f", <{k}> =")
    for k in range(len(old)):
        text = text.replace(f"<{k}>", json.dumps(f"{k:02}{names[k % len(names)]}").replace("\x7f", "\\u007f"))
    return text


def names():
    source = random.Random(1)
    alphabet = [chr(c) for c in range(32, 127)] + list("\n\r\t\u0085\u2028äψ") + list("\"'\\{}$&#%<>-*`@") * 6
    drawn = ["".join(source.choices(alphabet, k=source.randrange(1, 30))) for _ in range(40)]
    return [*([attack] for attack in ATTACKS), *([a, b] for a, b in zip(drawn[::2], drawn[1::2]))]


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    models = []
    for k, drawn in enumerate(names()):
        models.append(folder / f"boat{k}.toml")
        models[-1].write_text(toml(drawn), encoding="utf-8", newline="")
    write(folder, *models)
    return folder


def files(folder, pattern):
    found = sorted(folder.glob(pattern))
    assert len(found) >= len(names())
    return found


def skeleton(path, stem):
    """The syntax tree without texts and with one name of the class."""
    class Blank(ast.NodeTransformer):
        def visit_Constant(self, node):
            return ast.Constant("" if isinstance(node.value, str) else node.value)

    tree = Blank().visit(ast.parse(path.read_text().replace(stem, "boat")))
    return ast.unparse(tree)


def test_python(hostile, tmp_path):
    plain = tmp_path / "plain.toml"
    plain.write_text(toml(["a"]))
    write(tmp_path, plain)
    expected = skeleton(tmp_path / "plain.py", "plain")
    for path in files(hostile, "boat*.py"):
        assert skeleton(path, path.stem) == expected, path
        load(path)
    assert not pathlib.Path("owned").exists()


def test_xml(hostile):
    for path in files(hostile, "boat*_gz.sdf") + files(hostile, "boat*_vrx.sdf"):
        root = ElementTree.fromstring(path.read_bytes())
        assert root.tag == "plugin" and all(len(child) == 0 and child.text for child in root)
    for path in files(hostile, "boat*_inertial.sdf"):
        root = ElementTree.fromstring(path.read_bytes())
        assert [child.tag for child in root] == ["mass", "pose", "inertia", "fluid_added_mass"]


@pytest.mark.parametrize("folder", ["hostile", "exported"])
def test_latex(folder, request):
    folder = request.getfixturevalue(folder)
    for path in sorted(folder.glob("*.tex")):
        nodes, *_ = LatexWalker(path.read_text(encoding="utf-8"), tolerant_parsing=False).get_latex_nodes()
        environments = [node.environmentname for node in nodes if hasattr(node, "environmentname")]
        # Mass and derivatives, straight course, and actuators where there are some.
        assert environments in (["tabular"] * 3, ["tabular"] * 2), path
        macros = {node.macroname for node in nodes if hasattr(node, "macroname")}
        assert not macros, (path, macros)


def test_matlab(hostile, octave):
    calls = "".join(f"{path.stem}(zeros(6 + 11, 1), [0; 0; 0; 0]);\n" for path in files(hostile, "boat*.m"))
    script = f"function try_all()\n{calls}end\n"
    first = files(hostile, "boat*.m")[0]
    moving = first.read_text().split("kept.moving = [")[1].split("]")[0].split()
    script = script.replace("6 + 11", f"6 + {len(moving)}")
    (hostile / "try_all.m").write_text(script)
    octave(hostile, "try_all()")
    assert not (hostile / "owned").exists() and not pathlib.Path("owned").exists()


def test_each_vessel_is_xml(exported):
    for name in VESSELS:
        for kind in ["gz", "vrx"]:
            root = ElementTree.parse(exported / f"{name}_{kind}.sdf").getroot()
            assert any(child.tag.startswith("xU") and float(child.text) != 0.0 for child in root)
