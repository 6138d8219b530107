/* Search in what models said: replies are read chunk by chunk, and only when it is asked for. */
"use strict";

const Search = (() => {
  let text = "";
  let found = new Set();
  let turn = 0;

  const holds = (reply, wanted) => Boolean(reply) && String(reply.text).toLowerCase().includes(wanted);

  /** Rows whose reply holds the text, as far as they were read; `tell` hears how far that is. */
  function rows(wanted, tell) {
    const asked = wanted.trim().toLowerCase();
    if (asked !== text) {
      text = asked;
      found = new Set();
      read(asked, ++turn, tell);
    }
    return found;
  }

  async function read(asked, now, tell) {
    const mine = found;
    const { records } = Data.index.starts;
    for (let chunk = 0; chunk < records.length; chunk++) {
      const entries = await Data.chunk("records", chunk);
      if (now !== turn) return;
      entries.forEach((entry, i) => {
        const replies = entry.turns ? entry.turns.map((one) => one.reply) : [entry.reply];
        if (replies.some((reply) => holds(reply, asked))) mine.add(records[chunk] + i);
      });
      if (chunk % 8 === 7 || chunk === records.length - 1) tell((chunk + 1) / records.length);
    }
  }

  return { rows };
})();
