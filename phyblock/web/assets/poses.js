/* A plan with poses: as it was given, and the world after each step, with what became of it. */
"use strict";

const Poses = (() => {
  const CM = 100;
  const FAR_M = 0.5;
  const SLIGHT_CM = 0.25;
  const SLIGHT_DEG = 5;
  const ENDS = {
    stands: "stands", falls: "falls", knocks_over: "knocks others over", overlaps: "overlaps",
    under_floor: "under the floor", no_block: "no such block",
  };
  const PHYSICAL = ["interpenetrating", "floating", "toppling"];
  const REFUSED = ["overlaps", "under_floor", "no_block"];

  const cm = (value) => `${value.toFixed(value < 10 ? 1 : 0)} cm`;
  const inMeters = (center) => center.map((value) => value / CM);
  const distance = (a, b) => Math.hypot(...a.position.map((x, i) => x - b.position[i]));
  const sizeOf = ({ scores: [{ tp, fn }] }) => tp + fn;

  /** The block that a step puts, or null for a number that no candidate has. */
  function put(scene, given, number) {
    const candidate = scene.candidates[given.block - 1];
    if (!candidate) return null;
    const turned = { ...candidate, candidate: given.block };
    return { ...Solid.boxedAt(turned, inMeters(given.center_cm)), key: number };
  }

  /** The blocks in the world after each step: [{number of the step: block}, ...]. */
  function worlds(blocks, outcomes) {
    let now = {};
    return outcomes.map((outcome, i) => {
      now = { ...now };
      if (!REFUSED.includes(outcome.end)) now[i + 1] = blocks[i];
      for (const { step, center_cm: center, euler_deg: euler } of outcome.rests) {
        now[step] = Solid.boxedAt({ ...now[step], euler }, inMeters(center));
      }
      return now;
    });
  }

  /** Goal blocks that no block of their kind lies within `reached` [m] of, each of them for one. */
  function lacking(scene, blocks, reached) {
    const left = [...blocks];
    return scene.blocks.filter((wanted) => {
      const near = left.findIndex((block) => block.type === wanted.type && block.color === wanted.color
        && distance(block, wanted) <= reached);
      if (near >= 0) left.splice(near, 1);
      return near < 0;
    });
  }

  /** The run of a record; see Steps.of. Where resting poses were kept, the world is a second picture. */
  function of(scene, record) {
    const { pose: { steps: outcomes, reached, iou, limits }, parse: { steps: given } } = record;
    const steps = given.map((step, i) => described(scene, step, outcomes[i], i + 1));
    const end = `${reached} of ${Words.count(sizeOf(record), "block")} reached, IoU with the goal ${iou.toFixed(2)}.`;
    if (!scene) return { titles: ["Planned"], steps, states: [], end, ghosts: "" };
    const blocks = given.map((step, i) => put(scene, step, i + 1));
    const isKept = outcomes.every((outcome) => outcome.rests);
    const after = isKept ? worlds(blocks, outcomes) : [];
    const last = Object.values(after.at(-1) || {});
    const so = (i) => blocks.slice(0, i + 1).filter(Boolean);
    const states = given.map((_, i) => {
      const ghosts = ghostOf(scene, outcomes[i]), fresh = after[i]?.[i + 1] || null;
      const planned = { blocks: so(i), fresh: blocks[i], ghosts, arrow: arrowOf(blocks[i], ghosts[0], outcomes[i]) };
      if (!isKept) return [planned];
      // What was refused is outlined.
      return [planned, { blocks: Object.values(after[i]), fresh, ghosts: fresh || !blocks[i] ? [] : [blocks[i]] }];
    });
    const right = new Set(outcomes.filter(isThere).map(({ vertex }) => vertex));
    const missed = scene.blocks.filter((_, v) => !right.has(v));
    const whole = [{ blocks: so(given.length), ghosts: missed }];
    if (isKept) whole.push({ blocks: last, ghosts: lacking(scene, last, limits.reached_cm / CM) });
    const all = [...scene.blocks, ...so(given.length), ...after.flatMap(Object.values)];
    const framed = all.filter((block) => scene.blocks.some((one) => distance(one, block) <= FAR_M));
    const out = framed.length < all.length ? " Some blocks lie outside the picture." : "";
    return {
      titles: isKept ? ["Planned", "Built"] : ["Planned"], steps, end, framed,
      states: [whole.map(() => ({ blocks: [] })), ...states, whole],
      ghosts: `Outlined: where blocks should be${isKept ? `; goal blocks of whose kind none came to lie within ${limits.reached_cm} cm`
        : ". Where blocks came to lie was not kept in this run"}.${out}`,
    };
  }

  const isThere = ({ vertex, position_cm: off, turn_deg: turned }) =>
    vertex !== null && off <= SLIGHT_CM && turned <= SLIGHT_DEG;

  /** Where the block of a step should be, unless it is there. */
  const ghostOf = (scene, outcome) =>
    (outcome.vertex === null || isThere(outcome) ? [] : [scene.blocks[outcome.vertex]]);

  /** From where a block was put to where it should be, with the distance. */
  const arrowOf = (block, ghost, { position_cm: off }) =>
    (block && ghost && off > SLIGHT_CM ? { from: block.position, to: ghost.position, text: cm(off) } : null);

  function described(scene, given, outcome, number) {
    const verdict = outcome.error ? Words.named(outcome.error) : "Correct";
    const end = ENDS[outcome.end];
    return {
      number: given.block, name: Steps.nameOf(scene, given.block), why: outcome.error, verdict: `${verdict}, ${end}`,
      label: !outcome.error || PHYSICAL.includes(outcome.error) ? end : `${verdict}, ${end}`,
      text: [placeOf(given), offOf(scene, outcome), endOf(outcome, number)].filter(Boolean).join(" "),
      note: scene && ghostOf(scene, outcome).length ? "Outlined: where it should be." : "",
    };
  }

  function placeOf({ center_cm: center }) {
    return `Put at (${center.map((value) => Number(value.toFixed(2))).join(", ")}) cm.`;
  }

  function offOf(scene, outcome) {
    if (outcome.vertex === null) return "It matches no block of the goal.";
    const name = scene ? `its place ${Steps.placeOf(scene, outcome.vertex)}` : "its place in the goal";
    const turned = outcome.turn_deg >= 1 ? `, turned by ${outcome.turn_deg.toFixed(0)} degrees` : "";
    if (outcome.position_cm < 0.05) return `That is where ${name} is${turned}.`;
    const high = outcome.up_cm > 0 ? "too high" : "too low";
    const up = Math.abs(outcome.up_cm) < 0.05 ? "" : ` and ${cm(Math.abs(outcome.up_cm))} ${high}`;
    return `That is ${cm(outcome.position_cm)} from ${name}: ${cm(outcome.sideways_cm)} sideways${up}${turned}.`;
  }

  function endOf(outcome, number) {
    const others = (outcome.knocked || []).filter((one) => one !== number);
    return {
      no_block: "There is no such block.",
      under_floor: `Refused: it would be ${cm(outcome.overlap_cm)} under the floor.`,
      overlaps: `Refused: it would overlap others by ${cm(outcome.overlap_cm)}.`,
      falls: `When released, it falls and comes to rest ${cm(outcome.moved_cm)} from there.`,
      knocks_over: `When released, it knocks over the block${others.length > 1 ? "s of steps" : " of step"} ${others.join(", ")}.`,
    }[outcome.end] || "When released, it stands.";
  }

  /** Facts of a record in one line: [[name, value], ...]. */
  function facts(record) {
    const { pose, parse } = record;
    const right = pose.right.absolute;
    const whole = parse.plan.length + sizeOf(record);
    const f1 = right.reduce((sum, n) => sum + (2 * n) / whole, 0) / right.length;
    return [["F1 in C", Words.number(whole ? 100 * f1 : null)],
      ["Reached", `${pose.reached} of ${sizeOf(record)}`], ["IoU", pose.iou.toFixed(2)]];
  }

  return { of, facts };
})();
