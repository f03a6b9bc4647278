"""The example of the documentation."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

from conftest import exports

DOCUMENTS = Path(__file__).parents[3] / "docs"


def test_the_example_of_the_documentation_turns_the_otter(tmp_path):
    text = "\n".join(path.read_text() for path in sorted(DOCUMENTS.glob("export*.md")))
    (example,) = re.findall(r"```python\n(# CasADi: .*?)```", text, re.DOTALL)
    otter = next(folder for folder in exports() if folder.name == "craft_otter")
    shutil.copy(otter / "vessel.py", tmp_path / "otter.py")
    program = example + "print(*np.array(state).ravel())\n"
    result = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    state = [float(number) for number in result.stdout.split()]
    assert abs(state[0] - 1.0) < 0.02 and abs(state[-1] - 1.5708) < 0.02, state
