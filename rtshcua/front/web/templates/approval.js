"use strict";
(() => {
  const at = id => document.getElementById(id);
  const STORED = "rtshcua-approvals";
  const STAGES = {
    following: "Follows the flight. Keep this page open.",
    waiting: "The vehicle waits for a mission. Keep this page open.",
    lost: "The connection to the flight is lost. It is tried again.",
  };
  const EVERY = 700, AGAIN = 10000, SETTLED = 700;
  let session = "", shown = null, seen = 0, ends = 0, rang = 0, ready = 0, granted = null, busy = false, reached = true;
  let over = false, sound = null;

  const ask = async (path, body) => {
    const answer = await fetch(path, {
      method: "POST", body: JSON.stringify(body), cache: "no-store", redirect: "error", credentials: "omit",
      headers: {"Content-Type": "application/json", "Authorization": "Bearer " + session},
    });
    return {status: answer.status, told: await answer.json().catch(() => ({text: "the request was refused"}))};
  };

  const stop = text => {
    over = true;
    clear();
    at("stage").textContent = text;
  };

  const put = (id, text) => {
    at(id).textContent = text || "";
    at(id).hidden = !text;
  };

  const list = (id, each, make) => at(id).replaceChildren(...each.map(make));

  const made = (name, text, kind) => {
    const element = document.createElement(name);
    element.textContent = text;
    if (kind) element.className = kind;
    return element;
  };

  const clear = () => {
    shown = granted = null;
    at("question").hidden = true;
    at("none").hidden = over;
    document.title = "Approvals";
  };

  const choose = value => {
    granted = value;
    at("choose").hidden = value !== null;
    at("confirm").hidden = value === null;
    if (value === null || !shown) return;
    const what = value ? "may be flown" : "is refused";
    at("say").textContent = `Sign as ${shown.role} that step ${shown.step_number}, ${shown.skill}, ${what}?`;
    at("sign").className = value ? "yes" : "no";
    at("sign").textContent = value ? "Sign: approve" : "Sign: refuse";
    at("sign").focus();
  };

  const ring = () => {
    rang = performance.now();
    if (navigator.vibrate && navigator.userActivation && navigator.userActivation.hasBeenActive)
      navigator.vibrate([200, 100, 200]);
    if (!sound || sound.state !== "running") return;
    [880, 660, 880].forEach((pitch, number) => {
      const begin = sound.currentTime + number * 0.25, tone = sound.createOscillator(), loud = sound.createGain();
      tone.frequency.value = pitch;
      loud.gain.setValueAtTime(0.0001, begin);
      loud.gain.exponentialRampToValueAtTime(0.4, begin + 0.02);
      loud.gain.exponentialRampToValueAtTime(0.0001, begin + 0.22);
      tone.connect(loud).connect(sound.destination);
      tone.start(begin);
      tone.stop(begin + 0.24);
    });
  };

  const present = question => {
    shown = question;
    seen = question.number;
    choose(null);
    at("other-path").checked = false;
    at("result").textContent = "";
    at("what").textContent = `Step ${question.step_number}${question.skill ? ": " + question.skill : ""}`;
    at("awaited").textContent = `for ${question.missing.join(" and ")}; you answer as ${question.role}`;
    at("mission").textContent = question.mission || "";
    at("vehicle").textContent = question.vehicle || "";
    at("rule").textContent = question.rule;
    put("why-not", question.why_not && `You cannot answer this here: ${question.why_not}`);
    put("path", question.path && `It flies ${question.path}.`);
    put("spacing", question.spacing);
    put("warning", question.other_path && `Warning: ${question.other_path}`);
    at("other").hidden = !question.other_path;
    list("arguments", question.arguments || [], ({name, value, where}) => {
      const row = document.createElement("div"), told = made("dd", value);
      if (where) told.append(made("span", where, "where"));
      row.append(made("dt", name), told);
      return row;
    });
    at("drawn").hidden = !question.map;
    if (question.map) at("map").src = question.map;
    at("question").hidden = false;
    at("none").hidden = true;
    document.title = `Step ${question.step_number} waits for you`;
    ready = performance.now() + SETTLED;  // a tap that was meant for something else does nothing
    ring();
  };

  const show = told => {
    list("told", told.told.slice().reverse(), text => made("li", text));
    if (told.stage === "over") {
      stop(`${told.told[told.told.length - 1]}. This page is over.`);
      return;
    }
    at("stage").textContent = STAGES[told.stage];
    const question = told.question;
    if (!question) {
      if (shown) clear();
      return;
    }
    if (!shown || shown.number !== question.number) present(question);
    else shown.nonce = question.nonce;  // of the same question
    ends = performance.now() + question.left_ms;
  };

  const tick = () => {
    const now = performance.now();
    if (shown) {
      at("left").textContent = `${Math.ceil(Math.max(0, ends - now) / 1000)} s left`;
      if (now - rang > AGAIN && !busy) ring();
    }
    const may = Boolean(shown && shown.nonce && !shown.why_not && reached && !busy && now >= ready);
    at("approve").disabled = !may || (Boolean(shown.other_path) && !at("other-path").checked);
    for (const id of ["refuse", "sign"]) at(id).disabled = !may;
  };

  const sign = async () => {
    if (!shown || granted === null) return;
    const body = {nonce: shown.nonce, granted, other_path: at("other-path").checked};
    busy = true;
    at("sign").disabled = true;
    at("result").textContent = "The answer is handed in.";
    try {
      const {status, told} = await ask("/answer", body);
      at("result").textContent = status === 200 ? `Signed and accepted: ${told.text}` : `Not accepted: ${told.text}`;
      if (status === 200) clear();
      else choose(null);
    } catch {
      at("result").textContent = "Not known whether the answer arrived: see below.";
      choose(null);
    }
    busy = false;
  };

  const poll = async () => {
    try {
      const {status, told} = await ask("/state", {seen});
      if (status === 401) stop(`This page is not open any more: ${told.text}`);
      else if (status === 200) show(told);
      reached = true;
    } catch {
      reached = false;
      at("stage").textContent = "The command `rtshcua approve` does not answer: it has ended, or cannot be reached.";
    }
    if (!over) setTimeout(poll, EVERY);
  };

  const begin = async () => {
    const secret = location.hash.slice(1);
    session = sessionStorage.getItem(STORED) || "";
    history.replaceState(null, "", location.pathname);
    if (secret) {
      try {
        const {status, told} = await ask("/open", {secret});
        if (status === 200) sessionStorage.setItem(STORED, session = told.session);
        else if (!session) return stop(`This page cannot be opened: ${told.text}`);
      } catch {
        return stop("The command `rtshcua approve` does not answer.");
      }
    }
    if (!session) return stop("Open the address that `rtshcua approve` printed.");
    setInterval(tick, 200);
    poll();
  };

  at("sound").addEventListener("click", async () => {
    sound = sound || new AudioContext();
    await sound.resume();
    at("sound").textContent = "The sound is on: try it";
    ring();
  });
  at("approve").addEventListener("click", () => choose(true));
  at("refuse").addEventListener("click", () => choose(false));
  at("back").addEventListener("click", () => choose(null));
  at("sign").addEventListener("click", sign);
  begin();
})();
