/* What a sample did, step by step, as the stage shows it: whichever track it is of. */
"use strict";

const Runs = (() => {
  /** The run of a record in a setting; `score` says which step placed what, where one does. */
  function of(scene, record, setting, score) {
    if (record.turns) return Steps.ofTurns(scene, setting, record.turns);
    if (record.pose) return Poses.of(scene, record);
    return Steps.ofPlan(scene, setting, record.parse && score ? record.parse.plan : [], score);
  }

  return { of };
})();
