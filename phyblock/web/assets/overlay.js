/* On the drawing of a stage: the block that a wrong step tried, glowing where it would go, and
   the numbers of candidates on blocks, which tell them apart without their colors. */
"use strict";

const Overlay = (() => {
  const GLOW_CSS_PX = 9;
  let hasNumbers = true;

  /** Draw on a stage's pictures whenever the stage was drawn: its listener comes first. */
  function over(pictures, scene, run, player) {
    player.listeners.push(() => {
      const end = run.steps.length + 1;
      const at = player.at >= player.last ? end : Math.min(player.at, end);
      pictures.forEach(({ canvas }, place) => {
        const state = run.states[at]?.[place];
        if (state && canvas.clientWidth) paint(canvas, scene, run, state, run.steps[at - 1], player.view);
      });
    });
  }

  function paint(canvas, scene, run, state, step, view) {
    const shared = { view, framed: run.framed, size: canvas.clientWidth };
    const scratch = document.createElement("canvas");
    const context = canvas.getContext("2d");
    const tried = step ? block(scene, step) : null;
    if (tried) {
      const rgb = Stage.style("--tried-rgb");
      Solid.draw(scratch, [tried], { ...shared, fresh: tried, accent: rgb.split(",").map(Number) });
      context.shadowColor = `rgb(${rgb})`;
      context.shadowBlur = GLOW_CSS_PX * canvas.width / canvas.clientWidth;
      context.drawImage(scratch, 0, 0);
      context.drawImage(scratch, 0, 0);
      context.shadowBlur = 0;
    }
    if (!hasNumbers) return;
    const marks = state.blocks.map((one) => mark(scene, one)).filter(Boolean);
    if (tried) marks.push({ letter: String(step.number), position: tried.position });
    Solid.draw(scratch, [], { ...shared, marks });
    context.drawImage(scratch, 0, 0);
  }

  /** The number of the candidate that a block is, or one of its kind. */
  function mark(scene, one) {
    const isAlike = (other) => sameKind(one, other) && String(one.euler) === String(other.euler);
    const exact = scene.candidates.findIndex(isAlike);
    const n = one.candidate || (exact < 0 ? scene.candidates.findIndex((other) => sameKind(one, other)) : exact) + 1;
    return n ? { letter: String(n), position: one.position } : null;
  }

  /** Marks of the blocks of a scene, where numbers are wanted. */
  const marks = (scene) => (hasNumbers ? scene.blocks.map((one) => mark(scene, one)).filter(Boolean) : []);

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
    const candidate = scene.candidates[step.number - 1];
    const place = `the place of block ${scene.blocks[v].order}`;
    if (step.before.has(v)) return `Glowing: what was tried, in ${place}, which is taken.`;
    return sameKind(scene.blocks[v], candidate) ? `Glowing: what was tried, in ${place}.`
      : `Glowing: what was tried, in ${place}, the first that was open.`;
  }

  return {
    over, marks, words,
    get hasNumbers() {
      return hasNumbers;
    },
    set hasNumbers(isWanted) {
      hasNumbers = isWanted;
    },
  };
})();
