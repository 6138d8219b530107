/* What each step of a plan or episode did, and what could have been done, in words. */
"use strict";

const Steps = (() => {
  const readyIn = (scene, placed) =>
    scene.blocks.map((block, v) => v)
      .filter((v) => !placed.has(v) && scene.blocks[v].depend.every((d) => placed.has(d)));

  const sameKind = (a, b) => a.type === b.type && a.color === b.color;

  /** Candidate numbers that could stand for a goal block. */
  function standIns(scene, setting, block) {
    if (setting !== "B") return block.candidate ? [block.candidate] : [];
    return scene.candidates.map((_, i) => i + 1).filter((n) => sameKind(scene.candidates[n - 1], block));
  }

  /** What candidate `n` is, in words; nothing where there is none. */
  const nameOf = (scene, n) => (scene && scene.candidates[n - 1] ? Words.block(scene.candidates[n - 1]) : "");

  /** Where a block of the goal stands, in words: on what, and on which side where there are several. */
  function placeOf(scene, v) {
    const under = scene.blocks[v].depend.map((d) => Words.block(scene.blocks[d]));
    return under.length ? `on the ${[...new Set(under)].join(" and the ")}` : "on the floor";
  }

  const label = (scene, n) => (nameOf(scene, n) ? `${n} (${nameOf(scene, n)})` : String(n));

  function listed(scene, setting, vertices) {
    const said = new Map();
    for (const v of vertices) {
      const block = scene.blocks[v];
      const [first] = standIns(scene, setting, block);
      said.set(first || Words.block(block), first ? label(scene, first) : Words.block(block));
    }
    return [...said.values()].join(", ");
  }

  /** Why a candidate was wrong, with what the goal has instead. */
  function reason(scene, setting, number, why, placed) {
    const candidate = scene.candidates[number - 1];
    if (!candidate) return `There is no candidate ${number}.`;
    const open = scene.blocks.map((_, v) => v)
      .filter((v) => !placed.has(v) && sameKind(scene.blocks[v], candidate));
    const same = open.filter((v) => standIns(scene, setting, scene.blocks[v]).includes(number));
    const waits = (same.length ? same : open).flatMap((v) => scene.blocks[v].depend)
      .filter((d) => !placed.has(d));
    const words = [open, waits].map((vertices) => listed(scene, setting, vertices));
    const said = Words.reason(why, Words.block(candidate), ...words);
    return `${said[0].toUpperCase()}${said.slice(1)}.`;
  }

  /**
   * What the stage shows of a plan or an episode:
   *
   * `titles` of the pictures of a state; `framed`, the blocks that the camera is framed on;
   * `steps`: [{number, why, verdict, text, note, label, thumb}], one a frame of the strip;
   * `states`: nothing, each step, and the end, of each a picture {blocks, ghosts, fresh} a title;
   * `end`: what it came to, in words, and `ghosts` what its outlines are.
   */
  const run = (scene, titles, steps, states, end, ghosts, framed = scene && scene.blocks) =>
    ({ titles, steps, states, end, ghosts, framed });

  /** A run that places blocks of the goal where they belong: `steps` with sets `before` and `after`. */
  function ofSets(scene, steps, noun) {
    const last = steps.length ? steps[steps.length - 1].after : new Set();
    const wrong = steps.filter((step) => step.why).length;
    const of = scene ? ` of ${scene.blocks.length} blocks placed` : " blocks placed";
    const end = `${last.size}${of}${wrong ? `, ${Words.count(wrong, `wrong ${noun}`)}` : ""}.`;
    if (!scene) return run(scene, ["Built"], steps, [], end, "");
    const blocksOf = (set) => scene.blocks.filter((_, v) => set.has(v));
    const left = scene.blocks.filter((_, v) => !last.has(v));
    const shown = steps.map((step) => [{
      blocks: blocksOf(step.after), fresh: scene.blocks[step.vertex] || null,
      ghosts: step.ready.map((v) => scene.blocks[v]),
    }]);
    const drawn = steps.map((step, i) => ({ ...step, thumb: thumbOf(scene, step, shown[i][0]) }));
    const states = [[{ blocks: [] }], ...shown, [{ blocks: blocksOf(last), ghosts: left }]];
    return run(scene, ["Built"], drawn, states, end, left.length ? "Outlined: what was not placed." : "");
  }

  /** What stood after a step, or the wrong block alone. */
  function thumbOf(scene, step, state) {
    if (!step.why) return { blocks: state.blocks, fresh: state.fresh, framed: scene.blocks };
    return alone(scene.candidates[step.number - 1]);
  }

  const alone = (offered) => (offered ? { blocks: [Solid.onTheFloor(offered)], minDistance: 0.4 } : null);

  /** A plan: `placed` and `why` stand for each step as in the record. */
  function ofPlan(scene, setting, plan, score) {
    let now = new Set();
    const steps = plan.map((number, i) => {
      const vertex = score.placed[i], why = score.why[i];
      const step = { number, vertex, why, before: now };
      if (vertex !== null) now = new Set([...now, vertex]);
      return describe(scene, setting, { ...step, after: now });
    });
    return ofSets(scene, steps, "step");
  }

  /** An episode: a step for each, by the reply that decided it. */
  function ofTurns(scene, setting, turns) {
    let now = new Set();
    const steps = turns.filter((turn) => turn.outcome !== null).map((turn) => {
      const isPlaced = turn.outcome === "placed";
      const step = { number: turn.parse ? turn.parse.move : null, before: now, turn };
      now = new Set(turn.world || now);
      const vertex = isPlaced ? turn.placed : null;
      return describe(scene, setting, { ...step, vertex, why: isPlaced ? null : turn.outcome, after: now });
    });
    return ofSets(scene, steps, "turn");
  }

  function describe(scene, setting, step) {
    const verdict = step.why ? Words.named(step.why) : "Correct";
    const said = { ...step, verdict, name: nameOf(scene, step.number),
      label: step.why ? verdict : `Candidate ${step.number}`, ready: [] };
    if (!scene) return { ...said, text: "", note: "" };
    said.ready = step.why ? readyIn(scene, step.before) : [];
    const isNumber = Number.isInteger(step.number);
    let text = "";
    if (step.vertex !== null) text = `Placed ${placeOf(scene, step.vertex)}.`;
    else if (isNumber && step.why) text = reason(scene, setting, step.number, step.why, step.before);
    if (step.turn?.swapped?.length) text += " Blocks that look alike changed places for it.";
    if (step.turn?.fallen?.length) text += ` Let go, these blocks fall: ${step.turn.fallen.join(", ")}.`;
    const expected = said.ready.length && step.why !== "done" ? listed(scene, setting, said.ready) : "";
    return { ...said, text, note: expected && `Possible here (outlined): ${expected}.` };
  }

  /** The scene with its candidates in the order in which they were shown. */
  function asShown(scene, { shown, pose }) {
    if (!shown) return scene;
    const isUpright = pose?.rotation === "free";
    const candidates = shown.order.map((n) => scene.candidates[n - 1])
      .map((one) => (isUpright ? { ...one, euler: [0, 0, 0] } : one));
    const number = (block) => (isUpright ? candidates.findIndex((one) => Words.block(one) === Words.block(block))
      : shown.order.indexOf(block.candidate)) + 1;
    return { ...scene, candidates, blocks: scene.blocks.map((block) => ({ ...block, candidate: number(block) })) };
  }

  return { ofPlan, ofTurns, run, alone, nameOf, placeOf, asShown };
})();
