"""What the pages show is what the package prints."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs" / "_ext"))

from doc_examples import fences, run_page, write_output  # noqa: E402

PAGES = sorted(
    page
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    if not {"_build", "generated"} & set(page.parts)
)
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]


def has_slow(page):
    return any(fence.slow for fence in fences(page.read_text(encoding="utf-8")))


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_examples_print_what_the_page_shows(page, tmp_path):
    differences = run_page(page, tmp_path)
    assert not differences, "\n\n".join(map(str, differences))


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if has_slow(page)], ids=lambda p: p.name)
def test_slow_examples_print_what_the_page_shows(page, tmp_path):
    differences = run_page(page, tmp_path, slow=True)
    assert not differences, "\n\n".join(map(str, differences))


PAGE = """\
```{code-block} text
:caption: letters.txt

ACGT
```

```pycon
>>> from pathlib import Path
>>> Path("letters.txt").read_text()
'ACGT\\n'
>>> 1 + 1
3

```

<!-- slow -->
```pycon
>>> 2 + 2
5

```

```console
$ dnacheck --version
dnacheck, version nothing
$ make nothing
```
"""


def test_wrong_output_is_found_and_mended(tmp_path):
    page, folder = tmp_path / "page.md", tmp_path / "run"
    page.write_text(PAGE)
    folder.mkdir()
    found = run_page(page, folder)
    assert [(d.source, d.expected) for d in found] == [
        ("1 + 1", "3\n"),
        ("$ dnacheck --version", "dnacheck, version nothing\n"),
    ]
    assert [d.source for d in run_page(page, folder, slow=True)][1] == "2 + 2"
    write_output(page, found)
    assert run_page(page, folder) == []
