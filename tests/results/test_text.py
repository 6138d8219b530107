"""Tables as text, by hand."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from phyblock.results.text import NO_VALUE, Column, TextTable, to_latex, to_markdown

TABLE = TextTable(
    "Precision & recall (%)",
    (Column("Model", is_text=True), Column("Prec", "Level-1"), Column("F1", "Level-1")),
    (("gpt_4o|x", "9.5", "100.0 ± 12.5"), ("[b]*", NO_VALUE, "7.0 ± 0.5")),
    ("100 % of <all>.",),
)


def test_markdown_by_hand() -> None:
    assert to_markdown(TABLE) == (
        "**Precision &amp; recall (%)**\n"
        "\n"
        "| Model      | Level-1 Prec |   Level-1 F1 |\n"
        "| ---------- | -----------: | -----------: |\n"
        "| gpt\\_4o\\|x |          9.5 | 100.0 ± 12.5 |\n"
        "| \\[b\\]\\*    |            \N{EN DASH} |    7.0 ± 0.5 |\n"
        "\n"
        "- 100 % of \\<all\\>.\n"
    )


def test_latex_by_hand() -> None:
    assert to_latex(TABLE, "x").splitlines()[8:-2] == [
        r"\begin{tabular}{@{}lrr@{}}",
        r"\toprule",
        r" & \multicolumn{2}{c}{Level-1} \\",
        r"\cmidrule(lr){2-3}",
        r"Model & \multicolumn{1}{c}{Prec} & \multicolumn{1}{c}{F1} \\",
        r"\midrule",
        r"gpt\_4o\textbar{}x & 9.5 & 100.0 $\pm$ 12.5 \\",
        r"{[}b{]}{*} & \textendash{} & 7.0 $\pm$ 0.5 \\",
        r"\bottomrule",
        r"\end{tabular}}}",
        r"\par\smallskip\raggedright\footnotesize",
    ]


cells = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=8)


@given(st.lists(st.tuples(cells, cells), max_size=4))
def test_markdown_rows_have_as_many_cells_as_the_table_has_columns(
    rows: list[tuple[str, str]],
) -> None:
    columns = (Column("Model", is_text=True), Column("n"))
    text = to_markdown(TextTable("Any", columns, tuple(rows)))
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len(lines) == 2 + len(rows)
    for line in lines:
        assert line.replace("\\\\", "").replace("\\|", "").count("|") == 3
