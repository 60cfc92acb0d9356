"""The pages of docs/ and the README say what the code does."""

import ast
import doctest
import re
from pathlib import Path

import pytest
import typer
from shown_commands import PAGES, commands_shown

from cuspline.app import cli
from cuspline.values.finding_kinds import KINDS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def page(name):
    return (ROOT / "docs" / name).read_text()


def on_one_line(text):
    return " ".join(text.split())


# findings ---------------------------------------------------------------------------------------


def sections_of_findings():
    """{kind: (group, its text on one line)} of docs/findings.md."""
    found, group = {}, ""
    for level, title, body in re.findall(r"^(##+) (.*)\n((?:(?!##).*\n?)*)", page("findings.md"), re.M):
        if level == "##":
            group = title
        else:
            found[title.strip("`")] = (group, on_one_line(body))
    return found


def test_the_page_of_findings_has_every_kind_of_the_code_in_the_same_order():
    assert list(sections_of_findings()) == list(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_the_page_says_of_a_kind_what_the_command_says(kind):
    found = KINDS[kind]
    meaning = found.meaning[0].upper() + found.meaning[1:]
    assert sections_of_findings()[kind] == (
        found.group, f"{meaning}. **Example:** {found.example} **Fix:** {found.fix}")


def test_the_readme_leads_whoever_accepts_a_finding_to_the_page_of_kinds():
    row = next(line for line in README.splitlines() if "--accept excess" in line)
    assert "docs/findings.md" in row and "`cuspline findings`" in README


# formulas ---------------------------------------------------------------------------------------


def sources():
    """Every source file, once."""
    for folder in ("pipeline", "posts", "designs", "tests", "bench"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".toml", ".csv", ".js") and path.resolve() == path and path != Path(__file__):
                yield path


def test_every_formula_that_the_code_cites_is_on_the_page():
    there = set(re.findall(r"^## (\d+) ", page("formulas.md"), re.M))
    cited = {(str(path.relative_to(ROOT)), number) for path in sources()
             for number in re.findall(r"docs/formulas\.md (\d+)", path.read_text())}
    assert len(cited) > 10 and {number for _, number in cited} <= there
    assert [str(path) for path in sources() if re.search(r"\bFORMULAS\b", path.read_text())] == []


def test_the_check_numbers_of_the_formulas_are_true():
    done = doctest.testfile(str(ROOT / "docs/formulas.md"), module_relative=False)
    assert done.failed == 0 and done.attempted > 10


# glossary ---------------------------------------------------------------------------------------


def test_the_glossary_has_each_word_once_and_in_order():
    words = [row.split(",")[0].lower().replace("-", " ") for row in re.findall(r"^\| ([^|]+) \| ", page("glossary.md"), re.M)[1:]]
    assert words == sorted(set(words)) and len(words) > 50


# words ------------------------------------------------------------------------------------------

# what users read says it in the trade's words: docs/glossary.md
NOT_SAID = re.compile(r"\b(told|tells?|asks?|asked|reckon\w*|mend\w*|lies|lie|lying|askew|clampings?|hollows?|billets?|"
                      r"posed|eikonal|side cutter|right-angle head|spindle head)\b", re.I)


def texts_for_users(tree):
    """(line, text) of what a program may print: strings of several words, docstrings apart."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = {id(node.body[0].value) for node in ast.walk(tree)
                  if isinstance(node, documented) and node.body and isinstance(node.body[0], ast.Expr)}
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if is_text and id(node) not in docstrings and " " in node.value.strip():
            yield node.lineno, node.value


@pytest.mark.parametrize("folder", ["pipeline", "posts", "designs"])
def test_messages_speak_the_words_of_the_trade(folder):
    found = [f"{path.relative_to(ROOT)}:{line}: {text}" for path in sources()
             if path.suffix == ".py" and path.relative_to(ROOT).parts[0] == folder
             for line, text in texts_for_users(ast.parse(path.read_text())) if NOT_SAID.search(text)]
    assert found == []


@pytest.mark.parametrize("name", ["README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))),
                                  *(f"pipeline/report/{name}.html" for name in ("page", "sheet_body", "setup_sheet"))])
def test_pages_speak_the_words_of_the_trade(name):
    prose = re.sub(r"`[^`]*`|```.*?```|\{[{%].*?[}%]\}", "", (ROOT / name).read_text(), flags=re.S)
    assert NOT_SAID.findall(prose) == []


# commands ---------------------------------------------------------------------------------------

@pytest.mark.parametrize("name", [name for name in PAGES if any(commands_shown(name))])
def test_every_command_shown_is_one_that_the_command_line_takes(name):
    command = typer.main.get_command(cli.app)
    for words, has_arguments in commands_shown(name):
        if words[0].startswith("-"):
            assert any(words[0] in p.opts for p in command.params), words
            continue
        assert words[0] in command.commands, f"{name}: cuspline {' '.join(words)}"
        if has_arguments:
            command.commands[words[0]].make_context(words[0], words[1:])       # raises what the command line would say


def test_every_command_of_the_command_line_is_on_the_front_page():
    assert {name for name in typer.main.get_command(cli.app).commands if f"cuspline {name}" not in README
            and f"`{name}`" not in README} == set()


# front page -------------------------------------------------------------------------------------


def test_the_front_page_begins_with_a_picture_and_what_is_accepted():
    first = README.split("\n## ")[0]
    picture, = re.findall(r"!\[[^\]]+\]\((docs/pictures/\w+\.png)\)", first)
    assert 20_000 < (ROOT / picture).stat().st_size < 200_000
    assert "`gouge_mm`" in first and "`scallop_mm` + `profile_tolerance_mm`" in first
