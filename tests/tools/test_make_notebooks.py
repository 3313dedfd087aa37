"""Pages as notebooks: cells of text, code and commands, the same bytes each time; they run."""

from __future__ import annotations

from importlib.util import find_spec

import pytest
from test_documents import TUTORIALS

import rift_cl as rift

pytest.importorskip("jupytext", reason="jupytext is not installed")

PAGE = """# A page

Words, with a [link](../tomography.md#methods) and [another](https://example.org).

```python
import sys

print(6 * 7)
```

## Commands

```bash
# a remark
echo one \\
  two
rift --version
```

- a list
"""


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.md"
    path.write_text(PAGE)
    return path


def test_text_code_and_commands_are_cells(tool, page, monkeypatch):
    module = tool("make_notebooks")
    book = module.notebook(page)
    code = [cell.source for cell in book.cells if cell.cell_type == "code"]
    assert code[0] == "import sys\n\nprint(6 * 7)"
    assert code[1] == "%%script bash -e\n# a remark\necho one \\\n  two\nrift --version"
    text = "\n".join(cell.source for cell in book.cells if cell.cell_type == "markdown")
    assert "# A page" in text
    assert "- a list" in text
    assert "```" not in text


def test_links_lead_to_the_repository(tool):
    module = tool("make_notebooks")
    told = module._with_links("[a](../tomography.md#x) [b](https://c.d)", module.TUTORIALS / "e.md")
    assert told == "[a](../docs/tomography.md#x) [b](https://c.d)"


def test_the_same_page_gives_the_same_bytes(tool, page, tmp_path):
    module = tool("make_notebooks")
    for name in ("a.ipynb", "b.ipynb"):
        module.write(module.notebook(page), tmp_path / name)
    assert (tmp_path / "a.ipynb").read_bytes() == (tmp_path / "b.ipynb").read_bytes()


needs_kernel = pytest.mark.skipif(
    not (find_spec("nbclient") and find_spec("ipykernel")),
    reason="nbclient or ipykernel is not installed",
)


@needs_kernel
@pytest.mark.filterwarnings("ignore")  # zmq's, of event loops
def test_a_notebook_runs_and_keeps_its_outputs(tool, page):
    module = tool("make_notebooks")
    book = module.notebook(page)
    assert module.executed(book) == ""
    code = (cell for cell in book.cells if cell.cell_type == "code")
    outputs = ["".join(output.text for output in cell.outputs) for cell in code]
    assert outputs == ["42\n", f"one two\nrift {rift.__version__}\n"]


@needs_kernel
@pytest.mark.filterwarnings("ignore")
def test_a_command_that_fails_ends_a_notebook(tool, page):
    module = tool("make_notebooks")
    page.write_text("```bash\nfalse\necho on\n```\n")
    assert module.executed(module.notebook(page)).startswith("CalledProcessError")


# The code of each tutorial is run by tests/test_documents.py, without a notebook round it.
LONG = [pytest.param(name, marks=pytest.mark.study) for name in TUTORIALS if name != "own_parts"]


@needs_kernel
@pytest.mark.full
@pytest.mark.timeout(1200)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["own_parts", *LONG])
def test_a_tutorial_runs_as_a_notebook(tool, tmp_path, name):
    module = tool("make_notebooks")
    assert {page.stem for page in module.tutorials()} == TUTORIALS.keys()
    text = (module.TUTORIALS / f"{name}.md").read_text()
    for given, small in TUTORIALS[name].items():
        assert given in text
        text = text.replace(given, small)
    page = tmp_path / f"{name}.md"
    page.write_text(text)
    assert module.executed(module.notebook(page)) == ""
