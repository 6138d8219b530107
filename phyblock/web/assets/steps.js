/* What each step of a plan or episode did, and what could have been done, as the stage shows it and
   in words. */
"use strict";

const Steps = (() => {
  const sameKind = (a, b) => a.type === b.type && a.color === b.color;
  const vertices = (scene) => scene.blocks.map((_, v) => v);
  const readyIn = (scene, placed) => vertices(scene)
    .filter((v) => !placed.has(v) && scene.blocks[v].depend.every((d) => placed.has(d)));

  /** Candidate numbers that could stand for a goal block. */
  function standIns(scene, setting, block) {
    if (setting !== "B") return block.candidate ? [block.candidate] : [];
    return scene.candidates.flatMap((one, i) => (sameKind(one, block) ? [i + 1] : []));
  }

  /** The name of candidate `n`; nothing where there is none. */
  const nameOf = (scene, n) => (scene?.candidates[n - 1] ? Words.block(scene.candidates[n - 1]) : "");

  /** Where a block of the goal stands, in words. */
  function placeOf(scene, v) {
    const under = scene.blocks[v].depend.map((d) => Words.block(scene.blocks[d]));
    return under.length ? `on the ${[...new Set(under)].join(" and the ")}` : "on the floor";
  }

  /** Goal blocks as candidates that stand for them, each once. */
  function listed(scene, setting, all) {
    return [...new Set(all.map((v) => {
      const [first] = standIns(scene, setting, scene.blocks[v]);
      return first ? `${first} (${nameOf(scene, first)})` : Words.block(scene.blocks[v]);
    }))].join(", ");
  }

  /** Why a candidate was wrong, with what the goal has instead. */
  function reason(scene, setting, { number, why, before }) {
    const candidate = scene.candidates[number - 1];
    if (!candidate) return `There is no candidate ${number}.`;
    const open = vertices(scene).filter((v) => !before.has(v) && sameKind(scene.blocks[v], candidate));
    const same = open.filter((v) => standIns(scene, setting, scene.blocks[v]).includes(number));
    const waits = (same.length ? same : open).flatMap((v) => scene.blocks[v].depend).filter((d) => !before.has(d));
    const said = Words.reason(why, Words.block(candidate), ...[open, waits].map((some) => listed(scene, setting, some)));
    return `${said[0].toUpperCase()}${said.slice(1)}.`;
  }

  // ---- runs

  /**
   * The run of a record in a setting:
   *
   * `titles` of the pictures of a state; `framed`, the blocks that the camera is framed on; `steps`:
   * [{number, why, verdict, text, note, label, tried}]; `states`: nothing, each step, and the end, of
   * each a picture {blocks, ghosts, fresh, arrow} a title; `end`: the outcome in words, and `ghosts`
   * what its outlines are. Without a scene there are no states.
   */
  function of(scene, record, setting) {
    if (record.turns) return ofTurns(scene, setting, record.turns);
    if (record.pose) return Poses.of(scene, record);
    const score = scoreOf(record, setting);
    return ofPlan(scene, setting, record.parse && score ? record.parse.plan : [], score);
  }

  const scoreOf = (record, setting) =>
    record.scores.find((score) => score.setting === setting) || record.scores[0] || null;

  /** A plan: `placed` and `why` stand for each step as in the record. */
  function ofPlan(scene, setting, plan, score) {
    let now = new Set();
    return ofSets(scene, setting, "step", plan.map((number, i) => {
      const vertex = score.placed[i], before = now;
      if (vertex !== null) now = new Set([...now, vertex]);
      return { number, vertex, why: score.why[i], before, after: now };
    }));
  }

  /** An episode: a step for each turn. */
  function ofTurns(scene, setting, turns) {
    let now = new Set();
    return ofSets(scene, setting, "turn", turns.map((turn) => {
      const isPlaced = turn.outcome === "placed", before = now;
      now = new Set(turn.world || now);
      return { number: turn.parse?.move ?? null, vertex: isPlaced ? turn.placed : null,
        why: isPlaced ? null : turn.outcome, before, after: now, turn };
    }));
  }

  /** A run that places blocks of the goal where they belong: `steps` with sets `before` and `after`. */
  function ofSets(scene, setting, noun, plain) {
    const steps = plain.map((step) => described(scene, setting, step));
    const last = steps.at(-1)?.after || new Set();
    const wrong = steps.filter((step) => step.why).length;
    const of = scene ? ` of ${scene.blocks.length}` : "";
    const end = `${last.size}${of} blocks placed${wrong ? `, ${Words.count(wrong, `wrong ${noun}`)}` : ""}.`;
    if (!scene) return { titles: ["Built"], steps, states: [], end, ghosts: "" };
    const blocksOf = (set) => scene.blocks.filter((_, v) => set.has(v));
    const left = scene.blocks.filter((_, v) => !last.has(v));
    const shown = steps.map((step) => [{
      blocks: blocksOf(step.after), fresh: scene.blocks[step.vertex] || null,
      ghosts: step.ready.map((v) => scene.blocks[v]),
    }]);
    const states = [[{ blocks: [] }], ...shown, [{ blocks: blocksOf(last), ghosts: left }]];
    return { titles: ["Built"], steps, states, end, framed: scene.blocks,
      ghosts: left.length ? "Outlined: what was not placed." : "" };
  }

  function described(scene, setting, step) {
    const verdict = step.why ? Words.named(step.why) : "Correct";
    const said = { ...step, verdict, label: verdict, name: nameOf(scene, step.number), ready: [], text: "", note: "" };
    if (!scene) return said;
    if (step.why) {
      said.ready = readyIn(scene, step.before);
      if (Number.isInteger(step.number)) said.text = reason(scene, setting, step);
      const expected = said.ready.length && step.why !== "done" ? listed(scene, setting, said.ready) : "";
      said.note = expected && `Possible here (outlined): ${expected}.`;
      Object.assign(said, tried(scene, said));
    } else if (step.vertex !== null) said.text = `Placed ${placeOf(scene, step.vertex)}.`;
    if (step.turn?.swapped?.length) said.text += " Blocks that look the same changed places for it.";
    if (step.turn?.fallen?.length) said.text += ` Let go, these blocks fall: ${step.turn.fallen.join(", ")}.`;
    return said;
  }

  /** The block that a wrong step tried, where it would go, and that place in words. */
  function tried(scene, step) {
    const candidate = scene.candidates[step.number - 1];
    if (!candidate) return {};
    const ofKind = vertices(scene).filter((v) => sameKind(scene.blocks[v], candidate));
    const open = ofKind.filter((v) => !step.before.has(v));
    const exact = open.filter((v) => scene.blocks[v].candidate === step.number);
    const [v] = [...exact, ...open, ...ofKind.reverse(), ...step.ready];
    if (v === undefined) return {};
    const goal = scene.blocks[v], [x, y, z] = goal.position;
    // It stands on what the goal's block stands on.
    const lift = Solid.onTheFloor(candidate).position[2] - Solid.onTheFloor(goal).position[2];
    const why = step.before.has(v) ? ", a place that is taken" : ofKind.length ? "" : ", the first open place";
    return { tried: { ...candidate, position: [x, y, z + lift] },
      where: `Pink: what was tried, ${placeOf(scene, v)}${why}.` };
  }

  /** The number of the candidate that a block is, or one of its kind; "" for none. */
  function badge(scene, one) {
    const ofKind = scene.candidates.flatMap((other, i) => (sameKind(one, other) ? [i] : []));
    const exact = ofKind.find((i) => String(scene.candidates[i].euler) === String(one.euler));
    const n = one.candidate || (exact ?? ofKind[0] ?? -1) + 1;
    return n ? String(n) : "";
  }

  /** The scene with its candidates in the order in which they were shown. */
  function asShown(scene, { shown }) {
    if (!shown || !scene) return scene;
    const candidates = shown.order.map((n) => scene.candidates[n - 1]);
    const number = (block) => shown.order.indexOf(block.candidate) + 1;
    return { ...scene, candidates, blocks: scene.blocks.map((block) => ({ ...block, candidate: number(block) })) };
  }

  return { of, scoreOf, nameOf, placeOf, badge, asShown };
})();
