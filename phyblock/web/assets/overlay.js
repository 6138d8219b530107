/* On the drawing of a stage: the block that a wrong step tried, where it would go, and the numbers of
   candidates on blocks, which tell them apart without their colors. */
"use strict";

const Overlay = (() => {
  let hasNumbers = true;

  /** The number of the candidate that a block is, or one of its kind; "" for none. */
  function number(scene, one) {
    const isAlike = (other) => sameKind(one, other) && String(one.euler) === String(other.euler);
    const exact = scene.candidates.findIndex(isAlike);
    const n = one.candidate || (exact < 0 ? scene.candidates.findIndex((other) => sameKind(one, other)) : exact) + 1;
    return n ? String(n) : "";
  }

  /** The numbers of the blocks of a scene, where numbers are wanted. */
  const badges = (scene) => (hasNumbers ? scene.blocks.map((one) => number(scene, one)) : []);

  const sameKind = (a, b) => a.type === b.type && a.color === b.color;

  /** Goal blocks that a wrong step may have meant, the likeliest first. */
  function meant(scene, step) {
    const candidate = step.why && step.before ? scene.candidates[step.number - 1] : null;
    if (!candidate) return [];
    const all = scene.blocks.map((_, v) => v);
    const ofKind = all.filter((v) => sameKind(scene.blocks[v], candidate));
    const open = ofKind.filter((v) => !step.before.has(v));
    const exact = open.filter((v) => scene.blocks[v].candidate === step.number);
    if (exact.length || open.length) return [...exact, ...open];
    return ofKind.length ? ofKind.reverse() : step.ready;
  }

  /** The block that a wrong step tried, where it would go; null where nothing tells. */
  function block(scene, step) {
    const [v] = meant(scene, step);
    if (v === undefined) return null;
    const candidate = scene.candidates[step.number - 1];
    const goal = scene.blocks[v];
    const [x, y, z] = goal.position;
    // It stands on what the goal's block stands on.
    const lift = Solid.onTheFloor(candidate).position[2] - Solid.onTheFloor(goal).position[2];
    return { ...candidate, position: [x, y, z + lift] };
  }

  /** Where the tried block is drawn, in words. */
  function words(scene, step) {
    const [v] = meant(scene, step);
    if (v === undefined) return "";
    const place = Steps.placeOf(scene, v);
    if (step.before.has(v)) return `Glowing: what was tried, ${place}, a place that is taken.`;
    return sameKind(scene.blocks[v], scene.candidates[step.number - 1]) ? `Glowing: what was tried, ${place}.`
      : `Glowing: what was tried, ${place}, the first open place.`;
  }

  return {
    badges, number, block, words,
    get hasNumbers() {
      return hasNumbers;
    },
    set hasNumbers(isWanted) {
      hasNumbers = isWanted;
    },
  };
})();
