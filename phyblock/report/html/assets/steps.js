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

  const label = (scene, n) => {
    const candidate = scene.candidates[n - 1];
    return candidate ? `${n} (${Words.block(candidate)})` : String(n);
  };

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
    const name = Words.block(candidate);
    const all = scene.blocks.map((_, v) => v);
    const ofKind = all.filter((v) => sameKind(scene.blocks[v], candidate));
    const open = ofKind.filter((v) => !placed.has(v));
    if (why === "shape_not_in_gt") return `The goal has no ${name}.`;
    if (why === "overflow") {
      return ofKind.length === 1 ? `The only ${name} is already placed.`
        : `All ${ofKind.length} ${name} blocks of the goal are already placed.`;
    }
    if (why === "incorrect_orientation") {
      return `The goal needs a ${name} turned another way: candidate ${listed(scene, setting, open)}.`;
    }
    if (why === "dependency_not_met") {
      const same = open.filter((v) => standIns(scene, setting, scene.blocks[v]).includes(number));
      const waits = (same.length ? same : open).flatMap((v) => scene.blocks[v].depend)
        .filter((d) => !placed.has(d));
      return `Too early: it rests on ${listed(scene, setting, waits) || "blocks"}, not placed yet.`;
    }
    return `${Words.named(why)}.`;
  }

  /**
   * The states of a plan: [{number, vertex, why, before, after, text, expected}], one a step.
   *
   * `placed` and `why` stand for each step as in the record; `before` and `after` are sets of
   * goal blocks.
   */
  function ofPlan(scene, setting, plan, score) {
    let now = new Set();
    return plan.map((number, i) => {
      const vertex = score.placed[i], why = score.why[i];
      const step = { number, vertex, why, before: now };
      if (vertex !== null) now = new Set([...now, vertex]);
      return describe(scene, setting, { ...step, after: now });
    });
  }

  /** The states of an episode: one for each step, by the reply that decided it. */
  function ofTurns(scene, setting, turns) {
    let now = new Set();
    return turns.filter((turn) => turn.outcome !== null).map((turn) => {
      const isPlaced = turn.outcome === "placed";
      const step = { number: turn.parse ? turn.parse.move : null, before: now, turn };
      now = new Set(turn.world || now);
      const vertex = isPlaced ? turn.placed : null;
      return describe(scene, setting, { ...step, vertex, why: isPlaced ? null : turn.outcome, after: now });
    });
  }

  function describe(scene, setting, step) {
    if (!scene) return { ...step, text: "", expected: "", ready: [] };
    const ready = step.why ? readyIn(scene, step.before) : [];
    const isNumber = Number.isInteger(step.number);
    let text = "";
    if (step.vertex !== null) text = `Placed as block ${scene.blocks[step.vertex].order} of the goal.`;
    else if (isNumber && step.why) text = reason(scene, setting, step.number, step.why, step.before);
    if (step.turn?.swapped?.length) text += " Blocks that look alike changed places for it.";
    if (step.turn?.fallen?.length) text += ` Let go, these blocks fall: ${step.turn.fallen.join(", ")}.`;
    const expected = ready.length && step.why !== "done" ? listed(scene, setting, ready) : "";
    return { ...step, text, expected, ready };
  }

  return { ofPlan, ofTurns, label };
})();
