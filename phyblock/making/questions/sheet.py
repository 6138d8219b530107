"""A sheet for a human check: each question with pictures and options, the answer behind a fold."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Callable, Iterable, Sequence

from phyblock.domain.question import (
    LETTERS,
    SUBTASK_NAMES,
    Question,
    QuestionPicture,
    is_picture_option,
)

__all__ = ["Draw", "sheet_html"]

Draw = Callable[[QuestionPicture], bytes]
"""Gives the PNG of a picture."""

_STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #8882; }
body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 1180px; padding: 1.5rem; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.1rem; margin: 2.5rem 0 .5rem; }
article { border-top: 1px solid var(--line); padding: 1.2rem 0; }
header { color: #888; font-size: .85rem; } p.ask { font-size: 1.05rem; margin: .4rem 0 .8rem; }
.row { display: flex; flex-wrap: wrap; gap: .8rem; }
figure { margin: 0; } figcaption { font-size: .85rem; font-weight: 600; }
figure img { display: block; width: 300px; max-width: 100%; border-radius: 4px; }
.options figure img { width: 220px; }
ol { list-style: upper-alpha; padding-left: 1.6rem; margin: .8rem 0; }
summary { cursor: pointer; color: #888; } details { margin-top: .8rem; }
details pre { background: var(--soft); padding: .6rem; overflow-x: auto; white-space: pre-wrap; }
label { margin-right: 1rem; white-space: nowrap; } .check { margin-top: .6rem; font-size: .9rem; }
nav { display: flex; flex-wrap: wrap; gap: .1rem .9rem; }
.check b { color: #888; font-weight: 400; margin-right: .5rem; }
#out { width: 100%; height: 6rem; }
"""
_SCRIPT = """
const out = document.getElementById('out'), said = document.getElementById('said');
function tell() {
  const rows = [...document.querySelectorAll('article')].map(a => {
    const v = n => (a.querySelector(`input[name="${n}-${a.id}"]:checked`) || {}).value || '';
    const note = a.querySelector('input[type=text]').value.replaceAll('"', "'");
    return [a.id, v('mine'), v('fair'), note ? `"${note}"` : ''];
  }).filter(r => r.slice(1).some(Boolean));
  said.textContent = rows.length;
  out.value = ['id,mine,fair,note', ...rows.map(r => r.join(','))].join('\\n');
}
document.addEventListener('input', tell);
"""


def sheet_html(title: str, questions: Sequence[Question], draw: Draw) -> Iterable[str]:
    """The sheet in pieces, one a question; all in one file, so that it opens from a disk.

    `draw` gives the PNG of a picture. Whoever checks notes an answer and whether the question is
    fair beside each one, and takes what was noted as CSV from the foot of the page.
    """
    subtasks = list(dict.fromkeys(question.subtask for question in questions))
    links = "".join(f'<a href="#of-{code}">{SUBTASK_NAMES[code]}</a>' for code in subtasks)
    yield (
        '<!doctype html>\n<html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style>\n"
        f"<h1>{html.escape(title)}</h1><p>Answer each question from picture and text, then open "
        "the fold. What you note is collected as CSV at the foot of the page.</p>"
        f"<nav>{links}</nav>\n"
    )
    for code in subtasks:
        yield f'<h2 id="of-{code}">{code} · {html.escape(SUBTASK_NAMES[code])}</h2>\n'
        for question in questions:
            if question.subtask == code:
                yield _article(question, draw)
    yield (
        '<h2>Noted: <span id="said">0</span></h2><textarea id="out" readonly></textarea>'
        f"<script>{_SCRIPT}</script></html>\n"
    )


def _article(question: Question, draw: Draw) -> str:
    pictures = {picture.label: picture for picture in question.pictures}
    shown = [
        _figure(name, pictures[label], draw)
        for label, name in (("scene", ""), ("block", "the block"))
        if label in pictures
    ]
    options = (
        '<div class="row options">'
        + "".join(_figure(x, pictures[x], draw) for x in LETTERS if x in pictures)
        + "</div>"
        if any(map(is_picture_option, question.options))
        else "<ol>" + "".join(f"<li>{html.escape(one)}</li>" for one in question.options) + "</ol>"
    )
    evidence = html.escape(json.dumps(question.evidence, indent=1))
    return (
        f'<article id="{html.escape(question.id)}"><header>{html.escape(question.id)} · scene '
        f"{html.escape(question.scene.id)} · wording {html.escape(question.wording)}</header>"
        f'<p class="ask">{html.escape(question.text)}</p><div class="row">{"".join(shown)}</div>'
        f"{options}{_check(question)}<details><summary>Answer and evidence</summary>"
        f"<p><b>{question.answer_letters}</b></p><pre>{evidence}</pre></details></article>\n"
    )


def _figure(name: str, picture: QuestionPicture, draw: Draw) -> str:
    data = base64.b64encode(draw(picture)).decode("ascii")
    caption = f"<figcaption>{html.escape(name)}</figcaption>" if name else ""
    alt = html.escape(name or "the scene")
    return f'<figure>{caption}<img alt="{alt}" src="data:image/png;base64,{data}"></figure>'


def _check(question: Question) -> str:
    name = html.escape(question.id)
    mine = "".join(
        f'<label><input type="radio" name="mine-{name}" value="{letter}"> {letter}</label>'
        for letter in LETTERS
        if question.subtask != "OR"
    )
    fair = "".join(
        f'<label><input type="radio" name="fair-{name}" value="{word}"> {word}</label>'
        for word in ("fair", "unfair")
    )
    asked = f"<b>your answer</b>{mine}" if mine else ""
    return (
        f'<div class="check">{asked}<b>is it</b>{fair}'
        f'<label>note <input type="text" name="note-{name}"></label></div>'
    )
