"""The data card of a set of questions: how they were made, what was refused, what is in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from phyblock.domain.question import LETTERS, SUBTASK_NAMES, SUBTASKS, Question
from phyblock.making.questions.picture_view import COUNTED, NAMED, SHAPED, SHAPED_AREA, STUDIED
from phyblock.making.questions.shortcuts import SubtaskAudit
from phyblock.sim.registry import other_simulators

__all__ = ["question_card"]

_TEXT = """# {name}

{count} multiple-choice questions about {scenes} scenes of `{scenes_name}`, in {subtasks} subtasks
(paper, section 3.3 and appendix A.4), each with an answer that is derived from geometry, from the
dependency graph or from physics, and derived again by `phyblock vqa verify`. Made{simulators} by

    {made_by}

which gives the same bytes with any number of processes. No picture is stored: each is a recipe
(what differs from the scene, and from where it is seen) that is drawn when it is needed. The
version of the set stands in `VERSION`: results on different versions are never mixed.

## How they were made

Every scene gives drafts: fair questions with their right option, distractors and evidence. From
the drafts of all scenes chance leaves out some, until the texts of those kept tell nothing of what
is right (rejection sampling by a conditional logit over the texts, learned on other scenes). Of
these a greedy choice evens out sorts, wordings and sets of options, never answers: what is evened
out in a whole set is rare in one part where it was frequent in the other. The same block, color or
number is not asked about twice in a scene. Letters are drawn until each is right about as often.

Static questions and viewpoints are seen from all round, 18 to 38 degrees above the floor. Each
question has one of the six backgrounds. Both are drawn.

Texts come from templates with slots (`wording`). Blocks are named by color, type, layer, place in
the picture or what they rest on, so that exactly one block fits.

## Colors

The kit has one color for each shape but the cube, so that a color would tell a shape and a shape
a size or a place in the structure. Scenes are therefore recolored from the full palette, eight
types in five colors, for these subtasks:

* shape, color, relative position, absolute position, relative dependency: every block gets a color
  drawn for it;
* size, relative rotation: the blocks that are compared have colors that no other block has.

Other subtasks may recolor blocks in pictures that are options. `colors` in a line
holds the blocks whose color differs from the stored scene.

## What was refused, and the rules that came of it

Questions were answered from picture and text alone, before the answer was looked up.
What was unfair became a rule for all:

* blocks that are named show at least {named:.0%} of themselves, those whose shape, size or
  rotation is asked about {studied:.0%}; where blocks or layers are counted, every block of the
  scene shows {counted:.0%};
* where shapes or types are counted, every block shows {shaped:.0%} of itself and covers
  {area:.1%} of the picture: a short rectangular prism far away was taken for a cube;
* a name has to fit one block even for a reader who takes cubes for short rectangular prisms, or
  half cylinders for cylinders: "the blue cube" beside blue short prisms is refused;
* the shape of a half cylinder that stands upright and carries something is not asked for: seen
  from its round side it looks like a cylinder;
* "leftmost" and "farthest left" need a clear lead of the block's middle and of its outer edge: a
  long prism and a cube that end at the same place were refused; "highest" and "topmost" need 2 cm;
* left, right, in front and behind are offered in pairs ("behind and to the left"), because the
  view is oblique and a block is rarely only to the left; each part has to be clear by 3 cm;
* "nearest" needs at most three quarters of the distance of the next block;
* distances along the ground are asked for only within one structure and along the edges of
  blocks, where they can be counted in block lengths; between structures that stand apart depth
  could only be guessed;
* all lengths are multiples of 2.5 cm; values are at least 20 % apart;
* the scale that the text gives is a block that can be seen in the picture;
* the height of a block is asked for as its own ("from its lowest to its highest point"), because
  "tall" was taken for how high it stands;
* sizes compared differ by 30 % or more, or are a plain multiple;
* "type" in type counting says what it means: shape and size, not color;
* "layer" in layer counting says what it means: one more than the highest block below;
* a block is not said to be turned when a quarter turn maps it to itself, turns are steps of 30
  degrees, and a turned block rests on what it rested on;
* a layer is counted only where what rests on what can be told from heights: a block wedged
  between two roofs looks as if it stood beside them;
* outcomes are tried under four settings (time step, solver, friction from 0.28 to 0.45, masses 15 %
  off, and a floor that leans by 2 degrees to three sides); all must name the same blocks, each
  either clearly moved or clearly still;
* statics leave room for weights that are up to 5 mm off to any side, all to the same one, for long
  blocks of 0.87 to 1.15 times their mass and for those frictions: the blocks that stay stand with
  all of that, and those that go are borne with none of it, at no place in between either;
* of removals four in ten follow the rule that what rests on a block falls with it; in the others a
  support is one too many, or a weight holds what it stands on. Planks with weights or a column are
  added for them (`add`), on structures of which some upper blocks may be left out (`without`);
* pictures of removals say by colors what moves: all show one structure, before the removal. Wrong
  are lots of one to three blocks with all that rests on them; three are taken so that the right
  one's ranks among the four in eleven measures (how much is colored and where, how far from the
  block that is taken away, how well it fits either rule of support) and in how unlike the others it
  is are about those of any lot among any four;
* every picture of a push is what really follows one of four pushes close by, and which one is asked
  about is drawn; it goes as far as the text says in every setting, and came down or did not in all;
* blocks are pushed by a length that is no multiple of the grid of the structures;
* the four pictures of a next step add one and the same block, let down at places drawn alike; of
  those that do not stay three are taken so that the right one's rank among the four in colored
  area, and about its ranks in seven other measures of pixels, are drawn;
* stages of building are colored in pictures of the whole structure, so that none is larger for
  being early; a cut in four is refused where number, area or height of the blocks sorts it;
* places for a block are all on flat faces; at the right one the block comes down on the very face
  that is marked, at the others it does, or clearly meets a neighbor first; one that holds and three
  that do not are taken so that the right one's ranks in nine measures (distance from the middle of
  its block and from the other three, room round it, height, where it is, how much shows of its
  block) are about those of any place, and questions so that its ranks in three of them are each
  about as frequent (nearest to the middle of its block, highest in the picture, farthest from the
  others); they hold, or do not, also 1.25, 2.5 and 5 mm off in eight directions (next steps: 2.5, 5
  and 10 mm), and blocks without a clear middle, or that roll, are not put down;
* every block of a structure that another is let down on shows 12 % of itself; the block alone
  shows its profile, no face of it is more than four fifths of what shows, and its size stands in
  the text, because its picture has another scale;
* of places chance leaves out drafts that these measures tell most of (rejection sampling, as for
  texts);
* an arch, a triangular prism, a half cylinder or a cylinder is called that, and its shape asked
  for, only where its profile is turned to the viewer by 15 degrees: from behind an arch looks like
  a box;
* what is hidden is counted only where a block that shows rests on it alone, one at the most;
* heights are asked for "above the ground", left and right "in the picture";
* other viewpoints to a side are asked for from straight in front alone: a slanted view has a
  mirror image that could be one of the same side;
* options of viewpoints are one structure with two changes (mirrored, two colors exchanged, a block
  shifted) each made or not, with equal blocks and colors; the true one is drawn evenly, and the
  nearest histogram of visible colors is right for one of the four;
* options of viewpoints differ in a tenth of what shows of the blocks at least;
* pictures that are options differ in 220 of 256 x 256 pixels at least, and cut nothing off.

## What is in it

| subtask | | questions | scenes | wordings | A | B | C | D | most frequent answer |
|---|---|---|---|---|---|---|---|---|---|
{rows}

A to D: share of questions whose right option has that letter (ordering: that comes first). The
last column is the share of the most frequent right option text.
{audit}{attacks}
## The file

`questions.jsonl` holds one question a line; docs/vqa.md describes the fields.
"""

_AUDIT_TEXT = """
## Audit

From `phyblock vqa audit`:

| subtask | letters | chance | majority | text only | alike | repeats | named | least seen | most | base scenes |
|---|---|---|---|---|---|---|---|---|---|---|
{rows}

Letters: the rarest and the most frequent. Majority and text only: accuracy of the most frequent
answer and of a classifier of the texts, on questions about other base scenes than those they were
told the answers of. Alike: questions with options that read alike.
Repeats: questions that ask what another asks. Named: blocks that words name, and the least that
one of them shows of itself. Most: questions about the scene with most; base scenes: the scenes
asked about are made from so many.
"""  # noqa: E501


def question_card(
    name: str,
    scenes_name: str,
    questions: Sequence[Question],
    made_by: str,
    audits: Sequence[SubtaskAudit] = (),
    attacks: str = "",
) -> str:
    """Markdown text of the card of a set of questions called `name` about those scenes.

    `attacks` is the section about what attacks reach, empty for none.
    """
    by_subtask = {s: [q for q in questions if q.subtask == s] for s in SUBTASKS}
    return _TEXT.format(
        name=name,
        scenes_name=scenes_name,
        count=len(questions),
        scenes=len({question.scene.id for question in questions}),
        subtasks=sum(bool(asked) for asked in by_subtask.values()),
        made_by=made_by,
        simulators="".join(f", with {one}," for one in other_simulators()),
        named=NAMED,
        studied=STUDIED,
        counted=COUNTED,
        shaped=SHAPED,
        area=SHAPED_AREA,
        rows="\n".join(_row(asked) for asked in by_subtask.values() if asked),
        audit=_audit_text(audits) if audits else "",
        attacks=attacks,
    )


def _audit_text(audits: Sequence[SubtaskAudit]) -> str:
    return _AUDIT_TEXT.format(rows="\n".join(map(_audit_row, audits)))


def _audit_row(audit: SubtaskAudit) -> str:
    low, high = audit.letter_shares
    seen = "" if audit.least_seen is None else f"{audit.least_seen[0]:.0%}"
    text_only = "" if audit.text_only is None else f"{audit.text_only:.0%}"
    cells = [
        *(audit.subtask, f"{low:.0%} to {high:.0%}", f"{audit.chance:.0%}"),
        *(f"{audit.majority:.0%}", text_only, len(audit.ambiguous), len(audit.duplicates)),
        *(audit.named or "", seen, audit.most_of_a_scene, audit.bases),
    ]
    return f"| {' | '.join(map(str, cells))} |"


def _row(questions: Sequence[Question]) -> str:
    subtask, count = questions[0].subtask, len(questions)
    letters = Counter(question.answer[0] for question in questions)
    texts = Counter(question.options[question.answer[0]] for question in questions)
    scenes = {question.scene.id for question in questions}
    wordings = {question.wording for question in questions}
    shares = [f"{letters[i] / count:.0%}" for i in range(len(LETTERS))]
    most = "" if "<img1>" in texts or "place A" in texts else f"{max(texts.values()) / count:.0%}"
    cells = [subtask, SUBTASK_NAMES[subtask], count, len(scenes), len(wordings), *shares, most]
    return f"| {' | '.join(map(str, cells))} |"
