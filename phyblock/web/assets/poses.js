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
    const turned = { ...candidate, candidate: given.block, euler: given.euler_deg || candidate.euler };
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

  /** What the stage shows of a record. */
  function of(scene, record) {
    const { pose, parse } = record;
    const outcomes = pose.steps;
    const given = parse.steps;
    const steps = given.map((step, i) => describe(scene, step, outcomes[i], i + 1));
    const end = `${pose.reached} of ${Words.count(sizeOf(record), "block")} reached, IoU with the goal ${pose.iou.toFixed(2)}.`;
    if (!scene) return Steps.run(scene, ["Planned"], steps, [], end, "");
    const blocks = given.map((step, i) => put(scene, step, i + 1));
    const isKept = outcomes.every((outcome) => outcome.rests);
    const after = isKept ? worlds(blocks, outcomes) : [];
    const limit = pose.limits.reached_cm;
    const so = (i) => blocks.slice(0, i + 1).filter(Boolean);
    const states = given.map((_, i) => {
      const ghosts = ghostOf(scene, outcomes[i]);
      const planned = { blocks: so(i), fresh: blocks[i], ghosts, arrow: arrowOf(blocks[i], ghosts[0], outcomes[i]) };
      return isKept ? [planned, carried(after[i], blocks[i], i + 1)] : [planned];
    });
    const whole = [{ blocks: so(given.length), ghosts: missed(scene, outcomes) }];
    const last = after.length ? Object.values(after[after.length - 1]) : [];
    if (isKept) whole.push({ blocks: last, ghosts: lacking(scene, last, limit / CM) });
    const nothing = whole.map(() => ({ blocks: [] }));
    const all = [...scene.blocks, ...so(given.length), ...after.flatMap(Object.values)];
    const far = farAway(scene, all);
    const out = far.size ? " Some blocks lie outside the picture." : "";
    const note = isKept ? `Outlined: where blocks should be; goal blocks of whose kind none came to lie within ${limit} cm.${out}`
      : `Outlined: where blocks should be.${out} Where blocks came to lie was not kept in this run.`;
    const titles = isKept ? ["Planned", "Built"] : ["Planned"];
    return Steps.run(scene, titles, steps.map((step, i) => ({ ...step, thumb: thumbOf(scene, given[i], states[i]) })),
      [nothing, ...states, whole], end, note, all.filter((block) => !far.has(block)));
  }

  /** After a step; what was refused is outlined. */
  function carried(world, block, number) {
    const fresh = world[number] || null;
    return { blocks: Object.values(world), fresh, ghosts: fresh || !block ? [] : [block] };
  }

  function thumbOf(scene, given, state) {
    const { blocks, fresh } = state[state.length - 1];
    return fresh ? { blocks, fresh, framed: [...scene.blocks, fresh].filter((one) => !farAway(scene, [one]).size) }
      : Steps.alone(scene.candidates[given.block - 1]);
  }

  const isThere = ({ vertex, position_cm: off, turn_deg: turned }) =>
    vertex !== null && off <= SLIGHT_CM && turned <= SLIGHT_DEG;

  /** Where the block of a step should be, unless it is there. */
  const ghostOf = (scene, outcome) =>
    (outcome.vertex === null || isThere(outcome) ? [] : [scene.blocks[outcome.vertex]]);

  /** From where a block was put to where it should be, with the distance. */
  const arrowOf = (block, ghost, outcome) =>
    (block && ghost && outcome.position_cm > SLIGHT_CM ? { from: block.position, to: ghost.position, text: cm(outcome.position_cm) } : null);

  /** Blocks of the goal where no step puts theirs. */
  function missed(scene, outcomes) {
    const right = new Set(outcomes.filter(isThere).map(({ vertex }) => vertex));
    return scene.blocks.filter((_, v) => !right.has(v));
  }

  function farAway(scene, blocks) {
    const middle = { position: [0, 1, 2].map((i) => {
      const along = scene.blocks.map((block) => block.position[i]);
      return (Math.min(...along) + Math.max(...along)) / 2;
    }) };
    return new Set(blocks.filter((block) => distance(block, middle) > FAR_M));
  }

  function describe(scene, given, outcome, number) {
    const verdict = outcome.error ? Words.named(outcome.error) : "Correct";
    const end = ENDS[outcome.end];
    const isSaid = !outcome.error || PHYSICAL.includes(outcome.error);
    return {
      number: given.block, name: Steps.nameOf(scene, given.block), why: outcome.error, verdict: `${verdict}, ${end}`,
      label: isSaid ? end : `${verdict}, ${end}`,
      text: [placeOf(given), offOf(scene, outcome), endOf(outcome, number)].filter(Boolean).join(" "),
      note: scene && ghostOf(scene, outcome).length ? "Outlined: where it should be." : "",
    };
  }

  function placeOf({ center_cm: center, euler_deg: euler }) {
    const turned = euler ? `, turned (${euler.join(", ")}) degrees` : "";
    return `Put at (${center.map((value) => Number(value.toFixed(2))).join(", ")}) cm${turned}.`;
  }

  function offOf(scene, outcome) {
    if (outcome.vertex === null) return "It stands for no block of the goal.";
    const name = scene ? `its place ${Steps.placeOf(scene, outcome.vertex)}` : "its place in the goal";
    const turned = outcome.turn_deg >= 1 ? `, turned by ${outcome.turn_deg.toFixed(0)} degrees` : "";
    if (outcome.position_cm < 0.05) return `That is where ${name} is${turned}.`;
    const high = outcome.up_cm > 0 ? "too high" : "too low";
    const up = Math.abs(outcome.up_cm) < 0.05 ? "" : ` and ${cm(Math.abs(outcome.up_cm))} ${high}`;
    return `That is ${cm(outcome.position_cm)} from ${name}: ${cm(outcome.sideways_cm)} sideways${up}${turned}.`;
  }

  function endOf(outcome, number) {
    const { end } = outcome;
    if (end === "no_block") return "There is no such block.";
    if (end === "under_floor") return `Refused: it would be ${cm(outcome.overlap_cm)} under the floor.`;
    if (end === "overlaps") return `Refused: it would share space with others, ${cm(outcome.overlap_cm)} deep.`;
    if (end === "falls") return `Let go, it falls: it comes to lie ${cm(outcome.moved_cm)} from there.`;
    if (end === "knocks_over") {
      const steps = outcome.knocked.filter((one) => one !== number);
      return `Let go, it knocks over what step${steps.length > 1 ? "s" : ""} ${steps.join(", ")} put.`;
    }
    return "Let go, it stands.";
  }

  /** Facts of a record in one line: [[name, value], ...]. */
  function facts(record) {
    const { pose, parse } = record;
    const right = pose.right.absolute;
    const whole = parse.plan.length + sizeOf(record);
    const f1 = right.reduce((sum, n) => sum + (2 * n) / whole, 0) / right.length;
    return [["F1 in C", Words.percent(whole ? f1 : null)],
      ["Reached", `${pose.reached} of ${sizeOf(record)}`], ["IoU", pose.iou.toFixed(2)]];
  }

  return { of, facts };
})();
