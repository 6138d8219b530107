/* The session behind a server: it is asked for what is next, and told what was answered. */
"use strict";

const Session = (() => {
  async function checked(answer) {
    if (!answer.ok) throw new Error(String(answer.status));
    return answer.json();
  }
  const next = async (change) => checked(await fetch(change < 0 ? "state" : `state?after=${change}`));
  const post = async (name, body) => checked(await fetch(name, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  }));
  return { next, post };
})();
