/* Lets a reader verify the log of this page. It stands below verify.js in one module script, and uses:
   - `log` or `redacted-log`: a script element with what embedding.py wrote, of type application/gzip+base64
   - `pinned-key`: a text input, for the root key or its name in hexadecimal; a file may be dropped on it
   - `pinned-file`: a file input for the same (it may be missing)
   - `verify`: a button; `badge`: an element with role `status`; `verification`: an element for the details
   Texts of the log are untrusted: they are set as text only, with invisible characters escaped. */
(() => {
  "use strict";

  const find = (id) => document.getElementById(id);
  const [button, input, file, badge, details] = ["verify", "pinned-key", "pinned-file", "badge", "verification"].map(find);
  const log = find("log") ?? find("redacted-log");
  const redacted = log.id === "redacted-log";
  const MOST_FILE = 2 ** 20;
  const SAME_SOURCE = "A key from the same source as this page proves nothing: compare it with one that you have from the operator.";

  const visible = (text) =>
    text.replace(/[\p{Cc}\p{Cf}\p{Cs}\p{Zl}\p{Zp}]/gu, (each) => `\\u{${each.codePointAt(0).toString(16)}}`);
  const element = (name, text) => {
    const made = document.createElement(name);
    if (text !== undefined) made.textContent = visible(text);
    return made;
  };
  const list = (title, texts) => {
    const items = element("ul");
    items.append(...texts.map((text) => element("li", text)));
    return [element("p", title), items];
  };
  const state = (name, ...content) => {
    badge.className = name;
    badge.textContent = name;
    details.replaceChildren(...content.flat());
  };

  /** The octets of a key of 32 octets or a name of 16 in hexadecimal, or null. */
  const keyIn = (text) => {
    const digits = text.replace(/[\s:]/g, "");
    if (!/^(?:[0-9a-f]{64}|[0-9a-f]{32})$/i.test(digits)) return null;
    return Uint8Array.from(digits.match(/../g), (pair) => parseInt(pair, 16));
  };

  let source = "the key that you entered";
  let current = 0; // the verification that may still write into the page

  const forget = () => {
    current += 1;
    source = "the key that you entered";
    state("unverified");
  };

  const take = async (chosen) => {
    forget();
    const mine = current;
    const octets = chosen.size <= MOST_FILE ? new Uint8Array(await chosen.arrayBuffer()) : new Uint8Array();
    const text = octets.length < 200 ? new TextDecoder().decode(octets) : "";
    try {
      const trustRoot = keyIn(text) === null;
      const key = trustRoot ? await signerOf(octets) : keyIn(text);
      if (mine !== current) return;
      input.value = Array.from(key, (octet) => octet.toString(16).padStart(2, "0")).join("");
      source = trustRoot ? `the root key of the trust root in ${chosen.name}` : `the key in ${chosen.name}`;
      state("unverified", element("p", `The key to verify with is ${source}. ${SAME_SOURCE}`));
    } catch {
      if (mine !== current) return;
      input.value = ""; // not the key of an earlier file
      state("unverified", element("p", `${chosen.name} is neither a root key in hexadecimal nor a valid trust root.`));
    }
  };

  const bar = () => {
    const made = element("progress");
    made.max = 1;
    made.setAttribute("aria-label", "verification");
    return made;
  };

  const told = (result, pinned) => {
    const { verdict, failure, shortfall, records, shown, notShown } = result;
    const first = {
      verified: `The log verifies: all ${records} records, up to its signed end.`,
      incomplete: `The log is correct as far as it goes, but incomplete: ${shortfall?.text}.`,
      failed: `The log does not verify. Record ${failure?.record} (line ${failure?.record + 1}): ${failure?.text} (${failure?.slug}).`,
      redacted: `${shown[0]}.`,
    }[verdict];
    return [
      element("p", first),
      element("p", pinned ? `Verified with ${source}, ${pinned}. ${SAME_SOURCE}` : "No key was given."),
      ...(shown.length ? list("Shown:", redacted ? shown.slice(1) : shown) : []),
      ...list("Not shown:", notShown),
    ];
  };

  const verify = async () => {
    const pinned = keyIn(input.value);
    const needless = redacted && !input.value.trim();
    input.setAttribute("aria-invalid", String(!pinned && !needless));
    if (!pinned && !needless) {
      const text = "Enter the operator's root key: 64 digits in hexadecimal, or the 32 of its name; or drop its file on the field.";
      state("unverified", element("p", text));
      input.focus();
      return;
    }
    if (!globalThis.crypto?.subtle || !globalThis.DecompressionStream) {
      state("unverified", element("p", "This browser cannot verify here: open the page from a file or over https, in a current browser, or run `rtshcua verify-log`."));
      return;
    }
    const mine = (current += 1), progress = bar();
    state("checking", progress);
    const advance = (done, all) => (progress.value = done / all);
    const cannot = (error) => ({ verdict: "failed", records: 0, shown: [], notShown: ["anything: there is no log to verify"],
      failure: { record: 0, slug: error.slug ?? "log/unreadable", text: error.message } });
    const result = await embedded(log.textContent)
      .then((octets) => (redacted ? verifyRedacted(octets, pinned) : verifyLog(octets, pinned, advance)))
      .catch(cannot);
    if (mine === current) state(result.verdict, told(result, pinned && input.value.trim()));
  };

  input.addEventListener("input", forget);
  input.addEventListener("dragover", (event) => event.preventDefault());
  input.addEventListener("drop", (event) => {
    const [chosen] = event.dataTransfer.files;
    if (!chosen) return;
    event.preventDefault();
    take(chosen);
  });
  file?.addEventListener("change", () => file.files.length && take(file.files[0]));
  button.addEventListener("click", verify);
  state("unverified");
})();
