/* Verifies an evidence log (docs/log-format.md, version 4) in a browser. It stands below @noble/ed25519 in one module
   script, and uses its `Point`. Section numbers are those of that page. The slugs are those of `rtshcua verify-log`,
   and so is the order of the checks. Nothing here fetches, evaluates text as code, or writes into the page. */
const { embedded, verifyLog, verifyRedacted, signerOf, signatureCounts } = (() => {
  "use strict";

  const MOST_OCTETS = 2 ** 27; // as in embedding.py
  const LONGEST_LINE = 2 ** 26;
  const MOST_LINES = 2048, LONGEST_US = 20_000_000;
  const CHUNK = 512; // lines that are hashed at once
  const PAUSE_MS = 30; // work between two returns to the event loop
  const ZEROS = "0".repeat(64);
  const utf8 = new TextEncoder();
  // A BOM is an octet of a line like any other, and must not vanish.
  const strict = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

  /** A defect: a stable slug, and a sentence. `record` is the number of the record. */
  class Flaw extends Error {
    constructor(slug, text, record = null) {
      super(text);
      this.slug = slug;
      this.record = record;
    }
  }
  const check = (holds, slug, text) => {
    if (!holds) throw new Flaw(slug, text);
  };

  // ------------------------------------------------------------------------------------------------ octets

  const hex = (octets) => Array.from(octets, (octet) => octet.toString(16).padStart(2, "0")).join("");
  const unhex = (text) => Uint8Array.from(text.match(/../g) ?? [], (pair) => parseInt(pair, 16));
  const same = (a, b) => a.length === b.length && a.every((octet, n) => octet === b[n]);
  const concat = (...parts) => {
    const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
    let at = 0;
    for (const part of parts) {
      all.set(part, at);
      at += part.length;
    }
    return all;
  };
  const label = (text) => utf8.encode(text);

  const base64 = (octets) => {
    let text = "";
    for (let at = 0; at < octets.length; at += 0x8000) text += String.fromCharCode(...octets.subarray(at, at + 0x8000));
    return btoa(text);
  };
  /** The octets of canonical base64, or null. */
  const unbase64 = (text) => {
    try {
      const binary = atob(text), octets = new Uint8Array(binary.length);
      for (let n = 0; n < binary.length; n++) octets[n] = binary.charCodeAt(n);
      return btoa(binary) === text ? octets : null;
    } catch {
      return null;
    }
  };

  /** The octets of a text that `embedding.py` wrote: base64 of gzip. Stops where they are more than it embeds. */
  const embedded = async (text) => {
    const packed = unbase64(text.trim());
    check(packed, "log/unreadable", "the embedded log is not base64: it was changed");
    const reader = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip")).getReader();
    const parts = [];
    for (let size = 0; ; ) {
      const { done, value } = await reader.read().catch((error) => {
        throw new Flaw("log/unreadable", `the embedded log cannot be decompressed: it was changed (${error.message})`);
      });
      if (done) return concat(...parts);
      parts.push(value);
      size += value.length;
      if (size > MOST_OCTETS) {
        await reader.cancel();
        throw new Flaw("log/unreadable", `the embedded log has more than ${MOST_OCTETS} octets after decompression, and was not read`);
      }
    }
  };

  const digest = async (name, octets) => new Uint8Array(await crypto.subtle.digest(name, octets));
  const sha256 = (octets) => digest("SHA-256", octets);
  const leafOf = (line) => sha256(concat([0], line));
  const nodeOf = (left, right) => sha256(concat([1], left, right));

  // ------------------------------------------------------------------------------------------------ signatures

  const P = 2n ** 255n - 19n;
  const Y8 = 0x05fc536d880238b13933c6d305acdfd5f098eff289f4c345b027b2c28f95e826n;
  const SMALL = new Set([0n, 1n, P - 1n, Y8, P - Y8]); // y of the points of small order
  const littleEndian = (octets) => BigInt(`0x${hex(Uint8Array.from(octets).reverse())}`);

  /** Whether 32 octets may be a point: canonical, and not of small order. */
  const strong = (point) => {
    const y = littleEndian(point) & (2n ** 255n - 1n);
    return y < P && !SMALL.has(y);
  };

  const byBrowser = async (key, signature, message) => {
    const imported = await crypto.subtle.importKey("raw", key, "Ed25519", false, ["verify"]);
    return crypto.subtle.verify("Ed25519", imported, signature, message);
  };
  // noble's own `verify` multiplies by the cofactor, which section 6 forbids.
  const byNoble = async (key, signature, message) => {
    const [r, s] = [signature.subarray(0, 32), littleEndian(signature.subarray(32))];
    const a = Point.fromBytes(key), point = Point.fromBytes(r);
    const k = littleEndian(await digest("SHA-512", concat(r, key, message))) % Point.CURVE().n;
    return Point.BASE.multiply(s, false).equals(point.add(a.multiply(k, false)));
  };
  // Two signatures of tests/vectors/ed25519.json: one counts, and one only after multiplication by the cofactor. A
  // browser that does not tell them apart has another rule than section 6.
  const GOOD = ["d236927c63ccf3b0405cb7d5adfa0cd113e50f5615203e9120191aaee65130ac", "",
    "eff688a50c52dd52fca5dbf66d57d2c8deedc0103558536140ae1f19e17261fd7353ace53302a22e72748110049f4a22fd4bd072ca319720d703722b63214b01"];
  const COFACTOR = ["7f0d717af49730dea44a0f1c2038cbae02676531a056241744f29619f2ac15b6", "0000",
    "06df51f94083408951a7c56012370ea0a7f2258948723abfbd99de0ed6f2cbb03ada2c99393c9269c064a75fa85869d3a2e72a103aaec50af871309e21ad280c"];
  const followsRule = async () => {
    try {
      const [good, cofactor] = await Promise.all(
        [GOOD, COFACTOR].map(([key, message, signature]) => byBrowser(unhex(key), unhex(signature), unhex(message))),
      );
      return good && !cofactor;
    } catch {
      return false;
    }
  };
  let chosen = null;

  /** Whether a signature counts (section 6). `path` is "browser" or "noble"; by default the browser's if it has one. */
  const signatureCounts = async (key, signature, message, path = null) => {
    if (key.length !== 32 || signature.length !== 64 || !strong(key) || !strong(signature.subarray(0, 32))) return false;
    if (littleEndian(signature.subarray(32)) >= Point.CURVE().n) return false;
    chosen ??= followsRule();
    const verify = (path ?? ((await chosen) ? "browser" : "noble")) === "browser" ? byBrowser : byNoble;
    try {
      return await verify(key, signature, message);
    } catch {
      return false; // not a point of the curve
    }
  };

  // ------------------------------------------------------------------------------------------------ CBOR and COSE

  const SIMPLE = new Map([[0xf4, false], [0xf5, true], [0xf6, null]]);

  /** The only item of deterministic CBOR: maps become Map, integers a number, or a BigInt beyond 2^53. */
  const decode = (data) => {
    const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
    let at = 0;
    const refuse = (text) => {
      throw new Flaw("malformed", `not canonical CBOR: ${text}`);
    };
    const argument = (info) => {
      if (info < 24) return info;
      if (info > 27) refuse("indefinite or reserved length");
      const size = 1 << (info - 24);
      if (at + size > data.length) refuse("it ends in a length");
      const wide = size === 8 ? view.getBigUint64(at) : [view.getUint8, view.getUint16, view.getUint32][info - 24].call(view, at);
      if (wide < [24, 2 ** 8, 2 ** 16, 2 ** 32][info - 24]) refuse("not in the shortest form");
      if (wide > 2n ** 63n - 1n) refuse("an integer does not fit in 64 bits");
      at += size;
      return wide <= Number.MAX_SAFE_INTEGER ? Number(wide) : wide;
    };
    const item = (depth) => {
      if (at >= data.length) refuse("it ends before an item");
      const first = data[at++], major = first >> 5;
      if (major === 7) return SIMPLE.has(first) ? SIMPLE.get(first) : refuse("no such value");
      if (major === 6) refuse("a tag");
      const count = argument(first & 31);
      if (major === 0) return count;
      if (major === 1) return count === Number.MAX_SAFE_INTEGER || typeof count === "bigint" ? -1n - BigInt(count) : -1 - count;
      const items = major === 5 ? 2 * Number(count) : count;
      if (items > data.length - at) refuse("longer than the rest");
      if (major < 4) {
        const part = data.subarray(at, at + count);
        at += count;
        if (major === 2) return part;
        try {
          return strict.decode(part);
        } catch {
          return refuse("text is not UTF-8");
        }
      }
      if (depth >= 32) refuse("nested too deep");
      if (major === 4) return Array.from({ length: count }, () => item(depth + 1));
      const map = new Map();
      let before = null;
      for (let n = 0; n < count; n++) {
        const from = at, key = item(depth + 1), encoded = data.subarray(from, at);
        if (typeof key !== "string" && !integral(key)) refuse("a key is neither text nor an integer");
        if (before && order(before, encoded) >= 0) refuse("keys repeated or out of order");
        before = encoded;
        map.set(key, item(depth + 1));
      }
      return map;
    };
    const value = item(0);
    if (at !== data.length) refuse("something follows");
    return value;
  };
  const order = (a, b) => {
    const n = a.findIndex((octet, index) => octet !== b[index]);
    return n < 0 ? a.length - b.length : n >= b.length ? 1 : a[n] - b[n];
  };
  const octetString = (part) => {
    const n = part.length;
    const size = n < 24 ? [0x40 | n] : n < 256 ? [0x58, n] : n < 65536 ? [0x59, n >> 8, n & 255]
      : [0x5a, n >>> 24, (n >> 16) & 255, (n >> 8) & 255, n & 255];
    return concat(size, part);
  };

  const isOctets = (value) => value instanceof Uint8Array;
  const isText = (value) => typeof value === "string";
  const integral = (value) => Number.isSafeInteger(value) || typeof value === "bigint";

  /** The parts of a COSE_Sign1 (RFC 9052, section 4.2), unverified. */
  const envelopeOf = (data) => {
    check(data[0] === 0xd2, "malformed", "not a signed envelope: COSE_Sign1 begins with tag 18");
    const parts = decode(data.subarray(1));
    const shaped = Array.isArray(parts) && parts.length === 4 && isOctets(parts[0]) && parts[1] instanceof Map &&
      parts[1].size === 0 && isOctets(parts[2]) && isOctets(parts[3]) && parts[3].length === 64;
    check(shaped, "malformed", "not a COSE_Sign1 of four parts with a 64-byte signature");
    const [protectedHeader, , payload, signature] = parts;
    const header = protectedHeader.length <= 200 ? decode(protectedHeader) : null;
    const [content, kid] = header instanceof Map ? [header.get(3), header.get(4)] : [];
    check(header instanceof Map && header.size === 3 && header.get(1) === -19 && isText(content) && isOctets(kid) && kid.length === 16,
      "malformed", "the protected header must contain exactly algorithm, content type and key identifier");
    return { protectedHeader, payload, signature, content, kid };
  };

  /** The payload and the key of an envelope that one of these keys signed for a duty. */
  const openEnvelope = async (data, keys, duty, version, what = duty) => {
    const { protectedHeader, payload, signature, content, kid } = envelopeOf(data);
    check(content === `application/vnd.rtshcua.${what}+cbor`, "wrong-content-type", `the envelope does not hold a ${what}`);
    const key = keys.find((each) => same(each.kid, kid));
    check(key, "unknown-key", `key ${hex(kid)} is not in the trust root`);
    check(key.duty === duty, "wrong-duty", `key ${hex(kid)} is trusted for ${key.duty}, not for ${duty}`);
    const external = octetString(label(`rtshcua/duty/${duty}`));
    const signed = concat([0x84, 0x6a], label("Signature1"), octetString(protectedHeader), external, octetString(payload));
    check(await signatureCounts(key.public, signature, signed), "bad-signature", `key ${hex(kid)} did not sign these bytes for ${duty}`);
    return { body: artefact(payload, `rtshcua/${what}`, version), payload, key };
  };
  const artefact = (data, name, version) => {
    const value = decode(data);
    check(Array.isArray(value) && value.length === 3 && isText(value[0]) && integral(value[1]), "malformed", `not a ${name}`);
    check(value[0] === name, "unknown-format", `expected ${name}`);
    check(value[1] === version, "unknown-version", `${name} is not of version ${version}`);
    return value[2];
  };

  // ------------------------------------------------------------------------------------------------ the trust root

  const KEY_FIELDS = ["duty", "public", "roles", "sources", "vehicles", "expires_us", "development", "policies", "person"];
  const ROOT_FIELDS = ["version", "development", "issued_at_us", "expires_at_us", "keys", "thresholds"];
  const DUTIES = ["root", "policy", "mission", "approval", "log", "witness", "boundary"];
  const COUNTED = ["root", "policy", "mission", "approval", "log"]; // duties with a threshold of 1
  const SOURCES = ["agent", "operator", "onboard", "reflex"];
  const MOST_ROOT = 2 ** 20, MOST_BUNDLE = 2 ** 24, MOST_KEYS = 512, MOST_REVOKED = 4096;

  const keyId = async (duty, key) =>
    (await sha256(concat(label("rtshcua/key\0rtshcua/duty/"), label(duty), [0], key))).subarray(0, 16);

  const fieldsOf = (map, names, optional = []) => {
    const exact = map instanceof Map && names.every((name) => map.has(name)) &&
      [...map.keys()].every((name) => names.includes(name) || optional.includes(name));
    check(exact, "malformed", "not a trust root: not the fields that it has");
    return Object.fromEntries(map);
  };
  const texts = (value) => Array.isArray(value) && value.every(isText);

  const keyOf = async (map) => {
    const key = fieldsOf(map, KEY_FIELDS);
    const shaped = DUTIES.includes(key.duty) && isOctets(key.public) && key.public.length === 32 && texts(key.roles) &&
      texts(key.sources) && texts(key.vehicles) && texts(key.policies) && isText(key.person) &&
      typeof key.development === "boolean" && (key.expires_us === null || integral(key.expires_us));
    check(shaped && key.sources.every((source) => SOURCES.includes(source)), "malformed", "not a trust root: not a key");
    check(strong(key.public), "malformed", "a public key must be in canonical form and not of small order");
    const approves = key.duty === "approval";
    check((!key.person || approves) && (!key.policies.length || key.duty === "mission"),
      "malformed", `a key of duty ${key.duty} cannot have a person or policies`);
    check(!approves || (/^[a-z0-9][a-z0-9._-]{0,63}$/.test(key.person) && key.roles.length === 1 &&
      key.roles[0] !== "*" && key.sources.length === 1 && key.sources[0] === "operator"),
      "whose-approval", "an approval key must belong to one person, in one role and in person");
    return { ...key, kid: await keyId(key.duty, key.public) };
  };

  const rootOf = async (payload) => {
    const root = fieldsOf(artefact(payload, "rtshcua/root", 2), ROOT_FIELDS, ["revoked"]);
    const { version, issued_at_us: issued, expires_at_us: expires, revoked = null } = root;
    check([version, issued, expires].every(integral) && typeof root.development === "boolean" && Array.isArray(root.keys) &&
      root.keys.length <= MOST_KEYS, "malformed", "not a trust root");
    check(version >= 1 && expires > issued, "malformed", "the version must be at least 1, and the expiry later than the issue");
    const keys = [];
    for (const key of root.keys) keys.push(await keyOf(key));
    const thresholds = fieldsOf(root.thresholds, COUNTED, ["witness"]);
    const witnesses = thresholds.witness ?? 1;
    check(COUNTED.every((duty) => integral(thresholds[duty]) && thresholds[duty] >= 1), "malformed", "at least one signature is needed");
    check(COUNTED.every((duty) => thresholds[duty] === 1), "unsupported-threshold", "only one signature of a duty is supported");
    check(integral(witnesses) && witnesses >= 1, "malformed", "at least one witness is needed");
    check(witnesses === 1 || witnesses <= keys.filter((key) => key.duty === "witness").length,
      "unreachable-threshold", "the trust root requires more witnesses than it names");
    const names = new Set(keys.map((key) => hex(key.public)));
    check(names.size === keys.length, "shared-key", "a public key is named twice; each key has one duty");
    check(root.development || !keys.some((key) => key.development), "development-key", "only a development root may name a development key");
    if (revoked !== null) {
      const listed = Array.isArray(revoked) && revoked.length > 0 && revoked.length <= MOST_REVOKED &&
        revoked.every((name) => isOctets(name) && [8, 16].includes(name.length));
      const each = new Set(listed ? revoked.map(hex) : []);
      check(listed && each.size === revoked.length, "malformed", "`revoked` must list each key once, by its name");
      check(!keys.some((key) => each.has(hex(key.kid))), "revoked-key", "a key is both trusted and revoked");
    }
    return { version, development: root.development, expires, keys, witnesses };
  };

  /** The trust root in an envelope that the pinned key (32 octets, or its name of 16) signed, as of a UTC. */
  const openRoot = async (data, pinned, nowUs) => {
    check(data.length <= MOST_ROOT, "malformed", "a trust root has at most 1 MiB");
    const rootKeys = async () => (await rootOf(envelopeOf(data).payload)).keys.filter((key) => key.duty === "root");
    // Only the root itself tells the key behind a name, so it is parsed first then.
    const trusted = pinned.length === 32 ? [{ duty: "root", public: pinned, kid: await keyId("root", pinned) }]
      : (await rootKeys()).filter((key) => same(key.kid, pinned));
    const { payload, key: { kid } } = await openEnvelope(data, trusted, "root", 2);
    const root = await rootOf(payload);
    const key = root.keys.find((each) => each.duty === "root" && same(each.kid, kid));
    check(key, "not-self-signed", `key ${hex(kid)} is not one of the root keys in this root`);
    check(nowUs < root.expires, "expired", `root version ${root.version} has expired`);
    check(key.expires_us === null || nowUs < key.expires_us, "key-expired", "the key that signed the root has expired");
    return root;
  };

  /** The name (16 octets) of the root key that signed a trust root, which is valid by itself. */
  const signerOf = async (data) => {
    const { kid } = envelopeOf(data);
    await openRoot(data, kid, 0);
    return kid;
  };

  const refusalOf = (key, vehicle, nowUs) => {
    if (key.expires_us !== null && nowUs >= key.expires_us) return "key-expired";
    return key.vehicles.includes(vehicle) || key.vehicles.includes("*") ? null : "wrong-vehicle";
  };
  const authorised = (key, vehicle, nowUs, what) => {
    const refusal = refusalOf(key, vehicle, nowUs);
    check(refusal === null, refusal, `${what} ${hex(key.kid)} is not authorised for \`${vehicle}\` at the time: ${refusal}`);
  };

  /** Checks a bundle as section 6 has it; gives policy and mission. */
  const openBundle = async (data, root, vehicle, nowUs) => {
    check(data.length <= MOST_BUNDLE, "too-large", "a bundle has at most 16 MiB");
    const parts = artefact(data, "rtshcua/bundle", 1);
    check(Array.isArray(parts) && parts.length === 2 && parts.every(isOctets), "malformed", "a bundle must contain two envelopes");
    const policy = await openEnvelope(parts[0], root.keys, "policy", 7);
    const mission = await openEnvelope(parts[1], root.keys, "mission", 1);
    const [p, m] = [policy.body, mission.body];
    const shaped = Array.isArray(p) && Array.isArray(m) && isText(p[0]) && Array.isArray(p[2]) && texts(p[4]) && isText(m[0]) &&
      isOctets(m[6]) && Array.isArray(m[9]) && m[9].every((step) => Array.isArray(step) && isCount(step[4]) && step[4] in SOURCES && isCount(step[5]) && step[5] in p[4]);
    check(shaped, "malformed", "not a policy and a mission");
    const [name, version, [, identity], , roles] = p;
    const own = await sha256(concat(label("rtshcua/policy\0"), policy.payload));
    check(same(own, m[6]) && m[4] === name && m[5] === version, "wrong-policy", "the mission was signed for another policy than the one in this bundle");
    check(m[3] === identity, "wrong-vehicle", "the mission is for another vehicle than the policy");
    check(identity === vehicle, "wrong-vehicle", `the bundle is for \`${identity}\`, this vehicle is \`${vehicle}\``);
    authorised(policy.key, vehicle, nowUs, "the policy's key");
    const by = mission.key;
    for (const step of m[9]) {
      authorised(by, vehicle, nowUs, "the mission's key");
      check(by.sources.includes(SOURCES[step[4]]), "wrong-source", "the mission's key is not authorised for the source of a step");
      check(by.roles.includes(roles[step[5]]) || by.roles.includes("*"), "wrong-role", "the mission's key is not authorised for the role of a step");
      check(by.policies.includes(name) || by.policies.includes("*"), "key-other-policy", `the mission's key is not for \`${name}\``);
    }
    return { policy: `${name}@${version}`, mission: m[0] };
  };

  const renamed = async (prefix, text, promise) => {
    try {
      return await promise;
    } catch (error) {
      if (!(error instanceof Flaw)) throw error;
      throw new Flaw(`${prefix}-${error.slug}`, `${text}: ${error.message}`);
    }
  };

  /** Steps 2 and 3 of section 5: the trust in a genesis. */
  const trust = async (genesis, pinned) => {
    const [root, bundle] = [unbase64(genesis.root), unbase64(genesis.bundle)];
    check(root && bundle, "genesis/base64", "the trust root or the bundle is not canonical base64");
    const { vehicle, utc_us: nowUs } = genesis;
    const opened = await renamed("trust/root", "the trust root is not trusted", openRoot(root, pinned, nowUs));
    const key = opened.keys.find((each) => each.duty === "log" && hex(each.kid) === genesis.log_kid);
    check(key, "trust/log-key", "the log's key has no duty `log` in the trust root: the signer of this log was not authorised");
    const refusal = refusalOf(key, vehicle, nowUs);
    check(refusal === null, "trust/log-key", `the log's key was not authorised for vehicle \`${vehicle}\` at the time: ${refusal}`);
    const flown = await renamed("trust/bundle", "the bundle is not trusted", openBundle(bundle, opened, vehicle, nowUs));
    check(flown.mission === genesis.mission, "genesis/mission", "the log names another mission than its bundle");
    return { root: opened, ...flown };
  };

  // ------------------------------------------------------------------------------------------------ records

  const isInteger = (value) => Number.isSafeInteger(value);
  const isCount = (value) => isInteger(value) && value >= 0;
  const isHash = (value) => isText(value) && /^[0-9a-f]{64}$/.test(value);
  const isName = (value) => isText(value) && /^[0-9a-f]{32}$/.test(value);
  const isHex = (value) => isText(value) && /^(?:[0-9a-f]{2})*$/.test(value);
  const orNull = (holds) => (value) => value === null || holds(value);
  const listOf = (holds, length = null) => (value) =>
    Array.isArray(value) && (length === null || value.length === length) && value.every(holds);
  const object = (fields, optional = null) => (value) => {
    if (value === null || typeof value !== "object" || Array.isArray(value)) return false;
    const names = Object.keys(value);
    const all = Object.keys(fields).filter((name) => name !== optional || Object.hasOwn(value, name));
    return names.length === all.length && all.every((name) => Object.hasOwn(value, name) && fields[name](value[name]));
  };
  const isOutcome = (value) => ["allow", "deny", "defer", "fallback"].includes(value);
  const isDurability = (value) => isInteger(value) && value >= 0 && value <= 3;
  const isContext = object({
    approvals: listOf(listOf(isInteger, 5)), consumed: isInteger, phase: isInteger, policy_version: isInteger,
    released_us: isInteger, remaining_us: isInteger, vehicle: isText,
  });
  const isState = object({
    ages: listOf(isInteger), monitors: (value) => listOf(isInteger)(value) && value.length > 0, values: listOf(orNull(isInteger)),
  }, "monitors");

  const EACH = { at_us: isCount, seq: isCount, type: isText, utc_error_us: isCount, utc_us: isCount };
  const SIGNED = { ...EACH, _prev: isHash, checkpoint: orNull(isText) };
  const SEALING = { ...SIGNED, bytes: isCount, digest: isHash, epoch: isCount, records: isCount };
  const INTEGERS = Object.fromEntries(["kind", "link", "rule_step", "step", "target_link", "valid_until_us"].map((name) => [name, isInteger]));
  // `_prev` of the others is any text here: the chain is compared anyway, and names the record that was changed.
  const FORMS = Object.fromEntries(Object.entries({
    genesis: {
      ...SIGNED, before: orNull(isHash), boot: isName, bundle: isText, format: isText, log_key: isHash, log_kid: isName,
      mission: isText, mode: isText, next_key: isHash, received_us: isCount, root: isText, sync_us: isCount,
      vehicle: isText, version: isCount,
    },
    decision: {
      ...EACH, ...INTEGERS, _prev: isText, binding: isHex, clause: orNull(isText), clause_at: orNull(listOf(isInteger, 3)),
      context: isContext, durability: isDurability, invocation: isHex, mode: isText, outcome: isOutcome, reason: isText,
      state: isState, target: orNull(isText),
    },
    effect: {
      ...EACH, _prev: isText, detail: isText, durability: isDurability, event: isText, kind: isInteger, link: isInteger,
      step: isInteger, token: isInteger,
    },
    seal: { ...SEALING, next_key: isHash },
    recover: { ...SEALING, discarded_bytes: isCount, discarded_digest: isHash, next_key: isHash },
    close: { ...SEALING, ending: isText, tlog: orNull(isHash) },
  }).map(([type, fields]) => [type, object(fields)]));

  const sorted = (value) => {
    if (value === null || typeof value !== "object") return true;
    const names = Array.isArray(value) ? [] : Object.keys(value);
    return names.every((name, n) => n === 0 || names[n - 1] < name) && Object.values(value).every(sorted);
  };

  /** The record of a line without its newline: the only text in the form of RFC 8785 for it. */
  const read = (octets) => {
    let text, record;
    try {
      text = strict.decode(octets);
    } catch {
      throw new Flaw("record/malformed", "the line is not UTF-8");
    }
    try {
      record = JSON.parse(text);
    } catch {
      throw new Flaw("record/malformed", "the line is not JSON");
    }
    const type = record?.type;
    check(isText(type) && Object.hasOwn(FORMS, type), "record/malformed", "not a record: expected genesis, decision, effect, seal, recover or close");
    const known = type !== "genesis" || !isInteger(record.version) || record.version === 4;
    check(known, "genesis/format", "the format is not supported by this page");
    // JSON.parse accepts the escape of half a surrogate pair, and JSON.stringify writes it again.
    const whole = !/(?<!\\)(?:\\\\)*\\ud[89a-f]/i.test(text);
    check(whole && FORMS[type](record), "record/malformed", `malformed record of type ${type}`);
    // JSON.stringify writes texts and integers as RFC 8785 does, and keeps the order in which the keys stood. A key
    // that stood twice is there once.
    check(JSON.stringify(record) === text && sorted(record), "record/not-canonical", "the record is not in its canonical form (RFC 8785)");
    check(type !== "genesis" || record.format === "rtshcua/log", "genesis/format", "the format is not supported by this page");
    return record;
  };

  // ------------------------------------------------------------------------------------------------ tree and notes

  /** The Merkle tree of RFC 9162, section 2.1.1: all complete subtrees, so that each earlier root can be had. */
  class Tree {
    levels = [[]];

    get size() {
      return this.levels[0].length;
    }

    async add(leaves) {
      this.levels[0].push(...leaves);
      for (let n = 0; this.levels[n].length > 1; n++) {
        const below = this.levels[n], level = (this.levels[n + 1] ??= []), from = level.length;
        const made = await Promise.all(
          Array.from({ length: (below.length >> 1) - from }, (_, k) => nodeOf(below[2 * (from + k)], below[2 * (from + k) + 1])),
        );
        level.push(...made);
      }
    }

    async root(size) {
      if (size === 0) return sha256(new Uint8Array());
      let root = null;
      for (let n = 0, rest = size; rest; n++, rest >>>= 1) {
        if (rest & 1) {
          const left = this.levels[n][rest - 1];
          root = root === null ? left : await nodeOf(left, root);
        }
      }
      return root;
    }
  }

  const escaped = (text) => encodeURIComponent(text).replace(/[!'()*]/g, (each) => `%${each.charCodeAt(0).toString(16).toUpperCase()}`);
  const originOf = (genesis) => `rtshcua/log/${escaped(genesis.vehicle)}/${genesis.boot}`;
  const noteId = async (name, kind, key) => (await sha256(concat(label(`${name}\n`), [kind], key))).subarray(0, 4);

  /** The checkpoint in the text of a note. */
  const checkpointOf = (text) => {
    const lines = text.split("\n");
    const take = (prefix) => {
      const line = lines[4]?.startsWith(prefix) ? lines.splice(4, 1)[0] : null;
      return line === null ? null : unbase64(line.slice(prefix.length));
    };
    const [key, after] = [take("key "), take("after ")];
    const [origin, size, root, record] = lines;
    const note = { origin, size: Number(size), root: unbase64(root ?? ""), record: unbase64(record?.slice(7) ?? ""), key, after };
    const named = (prefix, value) => (value ? `${prefix} ${base64(value)}\n` : "");
    const again = `${origin}\n${note.size}\n${base64(note.root ?? [])}\n${named("record", note.record)}${named("key", key)}${named("after", after)}`;
    const whole = isInteger(note.size) && note.size >= 0 && again === text &&
      [note.root, note.record, key, after].every((each, n) => (n > 1 && each === null) || each?.length === 32);
    check(whole, "seal/note", "the signed text is not a checkpoint of origin, size, root, record, key and after");
    return note;
  };
  /** Text, name and octets of a note with exactly one signature of 64 octets. */
  const partsOf = (note) => {
    const at = note.lastIndexOf("\n\n");
    const line = at < 0 ? null : /^\u2014 ([^ \n]+) ([^ \n]+)\n$/.exec(note.slice(at + 2));
    const blob = line && unbase64(line[2]);
    check(blob && blob.length === 68, "seal/note", "the checkpoint does not end with one Ed25519 signature line");
    return { text: note.slice(0, at + 1), name: line[1], blob };
  };
  /** The checkpoint of a note that a key signed in the name of an origin; `digest` is SHA-256 of its text. */
  const openNote = async (note, origin, key) => {
    const { text, name, blob } = partsOf(note);
    check(name === origin && same(blob.subarray(0, 4), await noteId(origin, 1, key)),
      "seal/key", "the checkpoint is signed by another key, or in another name");
    check(await signatureCounts(key, blob.subarray(4), label(text)), "seal/signature", "the signature of the checkpoint is wrong");
    return { ...checkpointOf(text), digest: await sha256(label(text)) };
  };
  const ownLeaf = (record) => leafOf(label(`${JSON.stringify({ ...record, checkpoint: null })}\n`));
  const sameOrNull = (a, b) => (a === null || b === null ? a === b : same(a, b));

  // ------------------------------------------------------------------------------------------------ witnesses

  const LONGEST_NOTE = 2 ** 14;

  /** Compares what witnesses cosigned (section 5, anchors) with the log; reads the notes in the log alone. */
  class Witnesses {
    signed = new Map(); // by size, the digest of the log's checkpoint
    ahead = new Map(); // the same of notes, whose checkpoint is still to come, and the name of a witness
    seen = new Map(); // by key, the largest size that it cosigned

    constructor(root, genesis) {
      this.origin = originOf(genesis);
      this.threshold = root.witnesses;
      this.keys = root.keys.filter((key) => key.duty === "witness" && refusalOf(key, genesis.vehicle, genesis.utc_us) === null);
    }

    compare(size, own, seen, name) {
      check(own === seen, "anchor/root", `witness \`${name}\` saw another log at ${size} records: this one was rewritten`);
    }

    async take(record, checkpoint) {
      if (record.event === "anchored") await this.anchor(record.detail);
      if (!("checkpoint" in record)) return;
      const { size } = checkpoint, digest = hex(checkpoint.digest), waiting = this.ahead.get(size);
      this.signed.set(size, digest);
      this.ahead.delete(size);
      if (waiting) this.compare(size, digest, waiting.digest, waiting.name);
    }

    async anchor(note) {
      const at = note.lastIndexOf("\n\n"), text = note.slice(0, at + 1), below = note.slice(at + 2);
      if (note.length > LONGEST_NOTE || at < 0 || !below.endsWith("\n")) return;
      const signers = [];
      for (const line of below.slice(0, -1).split("\n")) {
        const found = await this.cosigner(line, text);
        if (found === false) return; // a wrong signature in the name of a witness: the note is no evidence
        if (found) signers.push(found);
      }
      let checkpoint = null;
      try {
        checkpoint = checkpointOf(text);
      } catch { /* not a checkpoint */ }
      if (!signers.length || checkpoint?.origin !== this.origin) return;
      const { size } = checkpoint, digest = hex(await sha256(label(text))), [{ name }] = signers;
      for (const signer of signers) if (!(this.seen.get(signer.key)?.size >= size)) this.seen.set(signer.key, { ...signer, size });
      if (!this.ahead.has(size)) this.ahead.set(size, { digest, name });
      const own = this.signed.get(size) ?? null, waiting = this.ahead.get(size);
      if (own === null) this.compare(size, digest, waiting.digest, waiting.name);
      else {
        this.ahead.delete(size);
        this.compare(size, own, digest, name);
      }
    }

    /** The witness who cosigned with this line; null for a line of anybody else, false for a wrong signature. */
    async cosigner(line, text) {
      const parts = /^\u2014 ([^ \n]+) ([^ \n]+)$/.exec(line), blob = parts && unbase64(parts[2]);
      if (blob?.length !== 76) return null;
      for (const key of this.keys) {
        if (!same(blob.subarray(0, 4), await noteId(parts[1], 4, key.public))) continue;
        const time = new DataView(blob.buffer, 4, 8).getBigUint64(0);
        const signed = label(`cosignature/v1\ntime ${time}\n${text}`);
        const holds = time < 2n ** 63n && (await signatureCounts(key.public, blob.subarray(12), signed));
        return holds && { key: hex(key.public), name: parts[1] };
      }
      return null;
    }

    /** How many records enough witnesses saw, at the end of a log of so many. */
    finish(records) {
      if (this.ahead.size) {
        const size = Math.max(...this.ahead.keys()), { name } = this.ahead.get(size);
        check(size < records, "anchor/beyond", `witness \`${name}\` saw a longer log: the end of this one was removed`);
        check(false, "anchor/root", `witness \`${name}\` saw a checkpoint of ${size} records, which is not in the log`);
      }
      const sizes = [...this.seen.values()].map(({ size }) => size).sort((a, b) => b - a);
      return sizes.length >= this.threshold ? sizes[this.threshold - 1] + 1 : 0;
    }
  }

  // ------------------------------------------------------------------------------------------------ the boundary

  const UTC_UNKNOWN = 2n ** 52n, APART_US = 2_000_000n, DRIFT_US = 500n;
  const MOST_MARKS = 128, MARK = 8, MOST_STATEMENT = 2048, MOST_SLOTS = 72, MOST_MONITORS = 32, MOST_WRITES = 32;
  const OUTCOMES = ["allow", "deny", "defer", "fallback"];
  // rtshcua/model/outcome.py, in the order of their numbers
  const REASONS = ["admitted", "integrity/binding-mismatch", "integrity/wrong-vehicle", "integrity/policy-version",
    "integrity/argument-out-of-range", "freshness/replayed", "freshness/issued-in-future", "freshness/expired",
    "freshness/clock-uncertain", "authority/class-not-permitted", "authority/forbidden", "authority/forbid-unknown",
    "authority/not-permitted", "authority/out-of-scope", "approval/awaited", "approval/refused", "approval/timed-out",
    "context/phase-not-reached", "context/phase-passed", "timing/no-slack", "state/violated", "state/unknown",
    "safety/envelope", "safety/airspace", "safety/invariant-violated", "safety/energy", "safety/degraded", "safety/unknown"];
  const STATUSES = ["", "malformed", "unknown_step", "not_current", "clock_apart", "clock_unknown"];
  const DOCUMENTS = ["", "approval", "recall", "replacement", "cancellation"];
  const WIDTHS = { B: [1, 0n], h: [2, 1n], H: [2, 0n], I: [4, 0n], q: [8, 1n], Q: [8, 0n] };

  /** Big-endian integers in the layout of Python's `struct`. Throws RangeError where one does not fit. */
  const packed = (layout, values) => {
    const parts = [...layout].map((kind, n) => {
      const [size, signed] = WIDTHS[kind], bits = 8n * BigInt(size), value = BigInt(values[n]), least = -(signed << (bits - 1n));
      if (value < least || value >= least + 2n ** bits) throw new RangeError(`${value} does not fit`);
      const octets = new DataView(new ArrayBuffer(8));
      octets.setBigUint64(0, BigInt.asUintN(64, value));
      return new Uint8Array(octets.buffer, 8 - size);
    });
    return concat(...parts);
  };
  const timesOf = (record) => [record.at_us, record.utc_us, record.utc_error_us];

  const decided = (record) => {
    const { state, context } = record, { values, ages, monitors = [] } = state;
    const [outcome, reason] = [OUTCOMES.indexOf(record.outcome), REASONS.indexOf(record.reason)];
    const fits = reason >= 0 && isHash(record.binding) && values.length === ages.length && values.length <= MOST_SLOTS && monitors.length <= MOST_MONITORS;
    if (!fits) throw new RangeError("not a request");
    const body = concat(
      packed("Bhh", [record.kind, record.step, record.link]), unhex(record.binding),
      packed("QQQQQH", [...timesOf(record), context.released_us, context.remaining_us, context.phase]),
      packed("q".repeat(values.length), values.map((value) => value ?? -(2n ** 63n))),
      packed("I".repeat(ages.length), ages), packed("B".repeat(monitors.length), monitors),
    );
    const name = label("rtshcua/request");
    const said = [outcome, reason, record.rule_step, Math.max(record.target_link, -1), record.valid_until_us, context.consumed];
    return [2, concat(packed("BBBhqB", said), [0x83, 0x60 | name.length], name, [2], octetString(body))];
  };
  /** The 32 bits of the float that is nearest to a decimal. */
  const bitsOf = (text) => {
    const value = Math.fround(/^[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$/.test(text) ? Number(text) : NaN) + 0;
    if (!Number.isFinite(value)) throw new RangeError("not a float");
    const view = new DataView(new ArrayBuffer(4));
    view.setFloat32(0, value);
    return view.getUint32(0);
  };
  const writes = (detail) => {
    const way = ["set ", "restore "].findIndex((word) => detail.startsWith(word)), listed = detail.slice(detail.indexOf(" ") + 1).split(", ");
    if (way < 0 || listed.length > MOST_WRITES) throw new RangeError("not a list of parameters");
    const parts = listed.map((write) => {
      const found = /^([A-Z0-9_]{1,16}) from (\S+) to (\S+)$/.exec(write);
      if (!found) throw new RangeError("not a parameter");
      return concat(label(found[1].padEnd(16, "\0")), packed("II", found.slice(2).map(bitsOf)));
    });
    return concat([way, parts.length], ...parts);
  };
  const EFFECTS = new Map([
    ["undecided", ({ detail }) => {
      const said = /^([a-z_]+) ([0-9a-f]{64})$/.exec(detail), status = STATUSES.indexOf(said?.[1], 1);
      if (status < 0) throw new RangeError("no status");
      return [3, concat([status], unhex(said[2]))];
    }],
    ...DOCUMENTS.slice(1).map((event, n) => [event, async (record) => {
      const document = unbase64(record.detail);
      if (!document) throw new RangeError("not base64");
      return [4, concat(packed("BhQQQ", [n + 1, record.step, ...timesOf(record)]), await sha256(document))];
    }]),
    ["dispatched", (record) => [6, packed("BhhQQ", [record.kind, record.step, Math.max(record.link, -1), record.token, record.at_us])]],
    ["refused", (record) => [7, concat(packed("Q", [record.at_us]), label(record.detail))]],
    ["permitted", ({ detail }) => [8, writes(detail)]],
    ["not-permitted", ({ detail }) => [9, label(detail)]],
  ]);
  /** Tag and payload of the boundary's entry for a record; null where it had no part in it. */
  const entryOf = async (record) => {
    const make = record.type === "decision" ? decided : EFFECTS.get(record.event);
    try {
      return make ? await make(record) : null;
    } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      throw new Flaw("boundary/record", "the record does not contain an entry that a boundary makes");
    }
  };
  const following = (digest, tag, payload) =>
    sha256(concat(label("rtshcua/boundary\0"), digest, packed("BI", [tag, payload.length]), payload));

  const STATEMENT = { flight: 16, session: 0, before: 32, count: 0, digest: 32, marks: null, frames: 0, left: 32, repeated: 0,
    declined: 0, stopped: 0, ahead: 0, aside: 32, source: 0, at: 0, utc: 0, error: 0 }; // 0: a number; else octets
  const COUNTED_BY = ["frames", "repeated", "declined", "stopped", "ahead"];
  const openStatement = async (data, keys) => {
    check(data && data.length <= MOST_STATEMENT, "malformed", "not a statement");
    const { body } = await openEnvelope(data, keys, "boundary", 2, "statement"), names = Object.keys(STATEMENT);
    const form = (value, size) => (size === 0 ? integral(value) && value >= 0 : isOctets(value) && (size === null || value.length === size));
    const shaped = Array.isArray(body) && body.length === names.length + 1 && names.every((name, n) => form(body[n], STATEMENT[name]));
    const said = shaped ? Object.fromEntries(names.map((name, n) => [name, body[n]])) : null;
    check(said && typeof body.at(-1) === "boolean" && said.marks.length % MARK === 0 && said.marks.length <= MARK * MOST_MARKS &&
      said.source <= 4, "malformed", "not a statement of a boundary");
    const marks = Array.from({ length: said.marks.length / MARK }, (_, n) => said.marks.subarray(MARK * n, MARK * (n + 1)));
    return { ...said, marks, count: Number(said.count), final: body.at(-1) };
  };

  /** Compares the records with the boundary's own evidence (section 7). Its flaws name the record. */
  class Boundary {
    digest = new Uint8Array(32);
    count = 0;
    pending = []; // entries that no statement covers yet
    marks = []; // of entries whose records are still to come
    last = null;
    stated = false; // in this epoch
    recovered = false;
    lost = null;
    gapEnd = null;

    constructor(root, genesis) {
      this.keys = root.keys.filter((key) => key.duty === "boundary" && refusalOf(key, genesis.vehicle, genesis.utc_us) === null);
      this.genesis = genesis;
      this.claim = this.claimed(genesis);
    }

    claimed(record) {
      const [at, utc, error] = timesOf(record).map(BigInt);
      return error < UTC_UNKNOWN ? { record: record.seq, at, ahead: utc - at, error } : null;
    }

    async take(record) {
      if (!this.keys.length) return;
      this.claim ??= this.claimed(record);
      const event = record.type === "effect" ? record.event : null;
      if (this.lost !== null) check(!this.makes(record), "boundary/after-loss", "the boundary was lost before this record, and so cannot have made its entry");
      else if (event === "boundary-lost") this.lose(record);
      else if (event === "boundary") await this.state(record);
      else if (record.type === "decision" || event !== null) {
        if (event === "stalled") this.gapEnd = BigInt(record.at_us);
        await this.enter(record);
      } else this.end(record);
    }

    /** Whether only a boundary makes a record. Links fly without it, and a missing answer counts as a refusal. */
    makes(record) {
      if (record.type !== "effect") return record.type === "decision";
      if (record.event === "refused" || record.event === "not-permitted") return false;
      const ofLink = record.event === "dispatched" && [1, 2].includes(record.kind);
      return record.event === "boundary" || (EFFECTS.has(record.event) && !ofLink);
    }

    unsigned(holds, when) {
      check(holds, "boundary/missing", `the boundary did not sign its own evidence ${when}: its statement was removed`);
    }

    complete() {
      check(this.count >= this.last.count, "boundary/omitted", "the boundary made entries before this that no record contains: the records were removed");
    }

    lose(record) {
      this.lost = record.seq;
      this.unsigned(this.last, "before this");
      this.complete();
    }

    async enter(record) {
      const entry = await entryOf(record);
      if (entry === null) return;
      this.unsigned(this.last, "before this");
      check(!this.last.final, "boundary/invented", "the boundary signed the number of its entries, and made no later entry for this record");
      this.digest = await following(this.digest, ...entry);
      this.count += 1;
      if (this.count > this.last.count) {
        this.pending.push({ record: record.seq, digest: this.digest });
        return;
      }
      const mark = this.marks.shift() ?? this.digest.subarray(0, MARK);
      this.differs(same(mark, this.digest.subarray(0, MARK)) && (this.count < this.last.count || same(this.digest, this.last.digest)));
    }

    differs(holds, record = null) {
      if (!holds) throw new Flaw("boundary/differs", "the boundary made no such entry here: this record was altered, invented or moved, or an earlier one was removed", record);
    }

    async state(record) {
      const said = await this.opened(record), { last } = this;
      check(same(said.flight, unhex(this.genesis.boot)), "boundary/other-flight", "the boundary signed this statement in another flight");
      let added = said.count - (last?.count ?? 0), { marks } = said;
      if (last === null) {
        const bundle = await sha256(unbase64(this.genesis.bundle));
        const begin = concat(packed("Q", [said.session]), said.before, said.flight, bundle, [this.genesis.mode === "none" ? 0 : 1]);
        [this.digest, this.count] = [await following(new Uint8Array(32), 1, begin), 1];
        check(marks.length && same(marks[0], this.digest.subarray(0, MARK)), "boundary/beginning", "the boundary's session did not begin with this flight, bundle and mode");
      } else {
        check(said.session === last.session && same(said.before, last.before), "boundary/other-session", "the boundary signed this statement in another session");
        const grows = said.count >= last.count && COUNTED_BY.every((name) => said[name] >= last[name]);
        check(!last.final && grows, "boundary/replayed", "the statement is older than the previous one, or follows the final one");
        this.complete();
      }
      check(marks.length === Math.min(added, MOST_MARKS), "boundary/missing", "the statement does not mark each entry since the previous one: an entry was removed, or the statement is older");
      if (last === null) [marks, added] = [marks.slice(1), added - 1];
      const { pending } = this;
      [this.pending, this.last, this.stated] = [[], said, true];
      for (const [n, entry] of pending.entries()) {
        if (n >= added) throw new Flaw("boundary/invented", "the boundary signed the number of its entries, and made no later entry for this record", entry.record);
        this.differs(n >= marks.length || same(marks[n], entry.digest.subarray(0, MARK)), entry.record);
      }
      this.marks = marks.slice(pending.length);
      check(this.count !== said.count || same(this.digest, said.digest), "boundary/differs", "the preceding records do not match what the boundary signed");
      this.time(record, said, BigInt(last === null ? said.at : last.at));
      const [gapEnd, at] = [this.gapEnd, BigInt(said.at)];
      this.gapEnd = null;
      check(gapEnd === null || at >= gapEnd - APART_US, "boundary/gap", "the boundary signed this statement before the end of the gap that precedes it");
    }

    async opened(record) {
      try {
        return await openStatement(unbase64(record.detail), this.keys);
      } catch (error) {
        if (!(error instanceof Flaw)) throw error;
        throw new Flaw(`boundary/${error.slug}`, `the boundary's signed statement is not trusted: ${error.message}`);
      }
    }

    /** Compares the time of day that the records claim with the boundary's own clock. */
    time(record, said, since) {
      const [at, utc, error] = [said.at, said.utc, said.error].map(BigInt), claims = [this.claim, this.claimed(record)];
      this.claim = null;
      for (const claim of claims.filter(Boolean)) {
        const from = claim.at > since ? claim.at : since, passed = at > from ? at - from : 0n;
        const off = at + claim.ahead - utc, allowed = claim.error + (passed * DRIFT_US) / 1_000_000n + APART_US;
        if (error >= UTC_UNKNOWN || (off < 0n ? -off : off) + error > allowed) {
          throw new Flaw("boundary/clock", "the claimed time of day differs from the boundary's own clock", claim.record);
        }
      }
    }

    end(record) {
      const { type } = record;
      const recovers = type === "recover" || (type === "close" && this.recovered && record.ending === "recovered");
      if (!recovers) {
        this.unsigned(this.last && this.stated && !this.pending.length, "at the end of this epoch");
        if (type === "close") {
          check(this.last.final, "boundary/not-ended", "the boundary did not sign an end here: later records were removed");
          this.complete();
        }
      }
      if (type === "recover") [this.recovered, this.claim] = [true, null];
      [this.stated, this.gapEnd] = [false, null];
    }

    /** What is shown of a log without a flaw, and what is not. */
    claims() {
      if (!this.keys.length) return [[], ["what the boundary itself decided and sent: the trust root has no key of duty `boundary` for this vehicle"]];
      if (this.last === null) return [[], ["what the boundary itself decided and sent: the log ends before its statement"]];
      const shown = [`session ${this.last.session} of the boundary signed for ${this.last.count - 1} decisions, documents and dispatches, which are the recorded ones in this order`];
      const notShown = ["that the frames of the telemetry are those that the boundary passed, and what it attests of its own code"];
      if (this.last.ahead) notShown.push(`whether any of the ${this.last.ahead} frames that the boundary signed ahead were sent: it cannot observe that`);
      if (!this.last.final || this.lost !== null) notShown.push("what the boundary did after its last statement");
      return [shown, notShown];
    }
  }

  // ------------------------------------------------------------------------------------------------ the walk

  /** Section 5, step 5: the clocks. Sums of two integers of 2^53 are exact as BigInt only. */
  class Clocks {
    at = 0n;
    low = 0n;
    apart = 0n;
    error = 0n;

    take(record) {
      const [at, utc, error] = [record.at_us, record.utc_us, record.utc_error_us].map(BigInt);
      const apart = utc - at, begins = record.type === "genesis";
      check(!begins || record.received_us <= record.at_us, "clock/received", "the bundle was received after the beginning of the log that contains it");
      if (begins || record.type === "recover") [this.apart, this.error] = [apart, error];
      else check(at >= this.at, "clock/backwards", "the monotonic time is before that of the previous record");
      check(utc + error >= this.low, "clock/utc-backwards", "the time of day is before that of an earlier record, by more than the stated errors of both");
      const off = apart - this.apart;
      check((off < 0n ? -off : off) <= error + this.error, "clock/utc-jump", "time of day and monotonic time advanced by different amounts, beyond the stated errors of both");
      this.at = at;
      if (utc - error > this.low) this.low = utc - error;
    }
  }

  /** Section 3: the duration of epochs, and gaps. */
  class Term {
    gaps = [];
    open = [];
    until = 0;
    last = 0;

    take(record, before) {
      if (record.type === "effect" && record.event === "stalled") {
        const silent = record.at_us - this.last;
        check(!this.told, "seal/gap", "a second gap is recorded in one epoch, which should have been sealed after the first");
        check(record.detail === `${silent} us`, "seal/gap",
          "the length of the recorded gap differs from the time since the previous record: a record was removed or moved");
        this.told = true;
        this.until += silent;
        this.open.push({ record: record.seq, us: silent, signed: null });
      }
      check(record.at_us <= this.until && before <= MOST_LINES, "seal/missing", "an epoch was left unsealed: its seal is missing before this record");
      this.last = record.at_us;
    }

    sign(record) {
      const silent = record.at_us - this.last;
      if (silent > LONGEST_US && ["seal", "close"].includes(record.type)) this.open.push({ record: record.seq, us: silent });
      this.gaps.push(...this.open.map((gap) => ({ ...gap, signed: record.seq })));
      [this.open, this.told] = [[], false];
      [this.last, this.until] = [record.at_us, record.at_us + LONGEST_US];
    }
  }

  /** Reads the lines of a log in order. */
  class Walk {
    seq = 0;
    offset = 0;
    prev = ZEROS;
    tree = new Tree();
    clocks = new Clocks();
    term = new Term();
    genesis = null;
    basis = null;
    close = null;
    checkpoint = null;
    epochs = 0;
    unsigned = 0; // lines that no key covered when a log was recovered
    recoveries = 0;
    discarded = 0;
    contradicted = null; // by a witness
    disputed = null; // by the boundary
    anchored = 0;

    constructor(octets, pinned) {
      this.octets = octets;
      this.pinned = pinned;
    }

    async line(line, leaf) {
      const record = read(line.subarray(0, -1));
      check(record.type !== "genesis" || !this.seq, "genesis/repeated", "the log contains the beginning of a second log");
      check(record.type === "genesis" || this.seq, "genesis/missing", "the log does not begin with its genesis: its beginning was removed");
      check(record.seq === this.seq, "chain/sequence",
        `found record ${record.seq} where record ${this.seq} is expected: records were removed, added or moved`);
      if (record._prev !== this.prev) {
        check(this.seq, "chain/broken", "the genesis names a previous record");
        return false;
      }
      this.clocks.take(record);
      if ("checkpoint" in record) await this.sign(record);
      else this.term.take(record, this.seq - this.first);
      if (record.type === "genesis") {
        this.basis = await trust(record, this.pinned);
        this.witnesses = new Witnesses(this.basis.root, record);
        this.boundary = new Boundary(this.basis.root, record);
      } else this.disputed ??= await this.flawOf(this.boundary.take(record));
      this.contradicted ??= await this.flawOf(this.witnesses.take(record, this.checkpoint));
      this.seq += 1;
      this.offset += line.length;
      this.prev = hex(leaf);
      return true;
    }

    /** The flaw that a check ends with, or null. The log itself is read on: a flaw of its own comes first. */
    async flawOf(checked) {
      try {
        await checked;
        return null;
      } catch (error) {
        if (!(error instanceof Flaw)) throw error;
        error.record ??= this.seq;
        return error;
      }
    }

    async sign(record) {
      const { type } = record;
      if (type === "genesis") {
        this.origin = originOf(record);
        this.logKey = unhex(record.log_key);
        check(hex(await keyId("log", this.logKey)) === record.log_kid, "genesis/log-key", "the log key is not the named one");
      } else {
        check(record.epoch === this.epochs, "seal/epoch", "the record ends another epoch than the present one: an epoch was removed, added or moved");
        check(record.records === this.seq - this.first, "seal/records", "wrong number of records in the epoch");
        check(record.bytes === this.offset - this.from, "seal/bytes", "wrong number of octets in the epoch");
        const segment = hex(await sha256(this.octets.subarray(this.from, this.offset)));
        check(record.digest === segment, "seal/digest", "the digest of the epoch does not match: at least one record was changed");
      }
      const key = type === "genesis" || type === "recover" ? this.logKey : this.checkpoint.key;
      const note = await openNote(record.checkpoint ?? "", this.origin, key);
      check(note.origin === this.origin, "seal/note", "the signature is for another log");
      check(note.size === this.seq, "seal/size", "the signature is for another number of records");
      check(same(note.root, await this.tree.root(this.seq)), "seal/root",
        "the signature does not match these records: at least one was changed, and the chain was rewritten");
      check(same(note.record, await ownLeaf(record)), "seal/self", "the record is not the signed one: a field was changed");
      check(sameOrNull(note.key, type === "close" ? null : unhex(record.next_key)), "seal/next-key",
        "the signature names another key for the next epoch than the record does");
      check(sameOrNull(note.after, this.checkpoint?.digest ?? null), "seal/after", "the signature does not follow that of the previous signed record");
      if (type !== "genesis") this.epochs += 1;
      if (type === "recover") {
        this.recoveries += 1;
        this.unsigned += record.records - 1;
        this.discarded += record.discarded_bytes;
      }
      this.checkpoint = note;
      this.term.sign(record);
      [this.first, this.from] = [this.seq, this.offset];
      if (type === "genesis") this.genesis = record;
      if (type === "close") this.close = record;
    }

    /** Why the log is incomplete (section 5, step 7), or null. Throws where it is broken. */
    end(torn) {
      if (this.close) return null;
      if (!torn.length) {
        check(this.seq, "log/empty", "the log is empty: nothing was written, or everything was removed");
        return { record: this.seq, slug: "close/missing", text: `the log ends after ${this.seq} records, without its signed close` };
      }
      const start = label(`{"_prev":"${this.prev}","at_us":`), n = Math.min(torn.length, start.length);
      const plausible = same(torn.subarray(0, n), start.subarray(0, n)) || torn.every((octet) => octet === 0);
      check(plausible, "record/malformed", "the data after the last complete record is not the beginning of another record");
      check(this.seq, "genesis/missing", "the log ends inside its first record");
      return { record: this.seq, slug: "tail/torn", text: `the log ends inside record ${this.seq}, after ${torn.length} of its bytes` };
    }
  }

  const pause = () => new Promise((resolve) => setTimeout(resolve));

  /** Reads all lines; gives why the log is incomplete, or null. */
  const walkThrough = async (walk, octets, progress) => {
    let paused = performance.now(), at = 0;
    for (;;) {
      const lines = [];
      for (let start = at; lines.length < CHUNK; ) {
        const end = octets.indexOf(10, start);
        if (end < 0) break;
        lines.push(octets.subarray(start, end + 1));
        start = end + 1;
      }
      const bounded = lines.findIndex((line) => line.length > LONGEST_LINE);
      if (bounded >= 0) lines.length = bounded + 1;
      const leaves = await Promise.all(lines.map((line) => leafOf(line.subarray(0, LONGEST_LINE))));
      await walk.tree.add(leaves);
      for (const [n, line] of lines.entries()) {
        check(!walk.close, "close/junk-after", "the signed close is followed by data that no key of this log signed");
        check(line.length <= LONGEST_LINE, "record/too-long", "the line is too long for a record");
        const broken = !(await walk.line(line, leaves[n]));
        at += line.length;
        if (broken) {
          const [before, after] = [walk.seq - 1, walk.seq];
          // The line behind both tells which of the two was changed: it follows the second if that is as it was.
          const follows = at < octets.length && same(octets.subarray(at + 10, at + 74), label(hex(leaves[n])));
          throw new Flaw("chain/broken", `record ${after} does not follow record ${before}: one of the two was changed`,
            follows || at >= octets.length ? before : after);
        }
        if (performance.now() - paused > PAUSE_MS) {
          progress(at, octets.length);
          await pause();
          paused = performance.now();
        }
      }
      if (!lines.length) break;
    }
    const torn = octets.subarray(at);
    check(!walk.close || !torn.length, "close/junk-after", "the signed close is followed by data that no key of this log signed");
    check(torn.length <= LONGEST_LINE, "record/too-long", "the line is too long for a record");
    return walk.end(torn);
  };

  const utcOf = (us) => {
    const date = new Date(us / 1000);
    return Number.isNaN(date.getTime()) ? `${us} us after the Unix epoch` : `${date.toISOString().slice(0, 19).replace("T", " ")}Z`;
  };
  const span = (first, end) => (end - first === 1 ? `record ${first}` : `records ${first} to ${end - 1}`);

  const claims = (walk, shortfall) => {
    const { genesis, basis, close, seq } = walk, sealed = walk.first + 1;
    const shown = [
      `the ${basis.root.development ? "development root" : "trust root"} is signed by the pinned key, and authorises log key ${genesis.log_kid} for vehicle \`${genesis.vehicle}\` as of ${utcOf(genesis.utc_us)}`,
      `mission \`${basis.mission}\` under policy \`${basis.policy}\` is signed for this vehicle, by keys that the root authorises`,
      `${span(0, seq)}: in the form of the format, in order, without a gap in the chain, with consistent clocks`,
      `${span(0, sealed)}: signed for, in ${walk.epochs} sealed ${walk.epochs === 1 ? "epoch" : "epochs"}`,
    ];
    const [notShown, [signed, unsigned]] = [[], walk.boundary.claims()];
    shown.push(...signed);
    if (walk.anchored) shown.push(`${span(0, Math.min(walk.anchored, seq))}: seen by enough witnesses, outside of the vehicle`);
    if (shortfall && close) notShown.push(shortfall.text);
    if (close) {
      const except = walk.recoveries ? `, except ${walk.unsigned} records that were unsigned when the log broke off, and the data after them` : "";
      shown.push(`the log is closed and signed: nobody without the log key, or the epoch keys of the time, changed, added or removed a record${except}`);
    } else {
      notShown.push(`${shortfall.text}: a removal of records from the end cannot be detected`);
      if (seq > sealed) notShown.push(`${span(sealed, seq)}: chained but not yet signed for: anyone could have rewritten them`);
    }
    if (walk.recoveries) {
      notShown.push(`recovered ${walk.recoveries === 1 ? "once" : `${walk.recoveries} times`}: that the last records before (unsigned then: ${walk.unsigned}) are unchanged, and that no others followed them (discarded: ${walk.discarded} octets)`);
    }
    for (const gap of [...walk.term.gaps, ...walk.term.open]) {
      const by = gap.signed === null ? "not signed for yet" : `the key that signed record ${gap.signed} vouches for it`;
      notShown.push(`what happened in a gap of ${gap.us / 1_000_000} s before record ${gap.record}: nothing was recorded; ${by}`);
    }
    if (basis.root.development) notShown.push("development keys are stored unencrypted: anyone who can read them can sign anything");
    notShown.push(...unsigned);
    if (walk.anchored < seq) {
      notShown.push(`${seq - walk.anchored} records are unanchored: a holder of the log key, or of later epoch keys, could have removed or rewritten them; this page reads the notes of witnesses in the log, and no files beside it`);
    }
    notShown.push(
      "that no key was revoked later: only newer trust roots tell",
      "that decisions follow from their recorded inputs, and commands from decisions: use `rtshcua verify-log --audit`",
      "that the recorded state is what the vehicle's sensors measured",
      "that the drawings and texts of this page agree with its log: make the page from the log again",
    );
    return { shown, notShown };
  };

  const failed = (error, records) => {
    const flaw = error instanceof Flaw ? error : new Flaw("log/unreadable", `the log cannot be verified: ${error}`);
    const record = flaw.record ?? records;
    return {
      verdict: "failed", records, failure: { record, slug: flaw.slug, text: flaw.message }, shortfall: null, shown: [],
      notShown: [`a log that fails verification proves nothing, neither about record ${record} nor about the others`],
    };
  };

  /** The verdict on the octets of a log under a pinned root key: 32 octets, or its name of 16. `progress` is called
      with the octets that were read, and all of them. `shortfall` says why a log is incomplete. */
  const verifyLog = async (octets, pinned, progress = () => {}) => {
    const walk = new Walk(octets, pinned);
    try {
      const ended = await walkThrough(walk, octets, progress);
      if (walk.contradicted) throw walk.contradicted;
      walk.anchored = walk.witnesses.finish(walk.seq);
      if (walk.disputed) throw walk.disputed;
      const { lost } = walk.boundary;
      const shortfall = ended ?? (lost === null ? null
        : { record: lost, slug: "boundary/lost", text: "the runtime reports that the boundary was lost in flight; only the runtime vouches for the following records" });
      return { verdict: shortfall ? "incomplete" : "verified", records: walk.seq, failure: null, shortfall, ...claims(walk, shortfall) };
    } catch (error) {
      return failed(error, walk.seq);
    }
  };

  // ------------------------------------------------------------------------------------------------ redacted logs

  const isNumbered = (list, size) => listOf((pair) => Array.isArray(pair) && pair.length === 2 && isCount(pair[0]) && isText(pair[1]))(list) &&
    list.every(([number], n) => number < size && (n === 0 || list[n - 1][0] < number));

  const readRedacted = (octets) => {
    let value = null;
    try {
      value = JSON.parse(strict.decode(octets));
    } catch { /* not JSON */ }
    const isDocument = object({
      checkpoints: (list) => Array.isArray(list), format: (name) => name === "rtshcua/redacted-log",
      leaves: listOf((leaf) => isText(leaf) && unbase64(leaf)?.length === 32), lines: (list) => Array.isArray(list),
      root: (root) => isText(root) && unbase64(root)?.length === 32, version: (version) => version === 1,
    });
    check(isDocument(value) && isNumbered(value.lines, value.leaves.length) && isNumbered(value.checkpoints, value.leaves.length),
      "redacted/malformed", "not a redacted log, version 1");
    return { ...value, leaves: value.leaves.map(unbase64), root: unbase64(value.root) };
  };

  /** Checks what a redacted log still has. The verdict is never that it is verified: most of it is not there. */
  const verifyRedacted = async (octets, pinned = null) => {
    let at = 0;
    try {
      const { leaves, lines, checkpoints, root } = readRedacted(octets);
      const tree = new Tree();
      await tree.add(leaves);
      check(same(root, await tree.root(tree.size)), "redacted/root", "the root does not follow from the leaves: at least one was changed");
      const records = new Map();
      for (const [number, text] of lines) {
        at = number;
        const line = label(`${text}\n`);
        check(same(await leafOf(line), leaves[number]), "redacted/line", "the line is not the one of its leaf: one of the two was changed");
        const record = read(line.subarray(0, -1));
        check(record.seq === number && (record.type === "genesis") === (number === 0), "chain/sequence", "the line has another place in its log");
        check(record._prev === (number ? hex(leaves[number - 1]) : ZEROS), "chain/broken", `record ${number} does not follow record ${number - 1}`);
        records.set(number, record);
      }
      at = 0;
      const genesis = records.get(0) ?? null;
      const basis = genesis && pinned ? await trust(genesis, pinned) : null;
      const notes = new Map(checkpoints);
      for (const [number, record] of records) {
        at = number;
        if (!("checkpoint" in record)) continue;
        const stated = checkpoints.length ? notes.get(number) : record.checkpoint;
        check(stated === record.checkpoint, "redacted/checkpoint", "the checkpoint is not that of its record");
        notes.set(number, record.checkpoint);
      }
      const listed = checkpoints.length > 0;
      const signed = await signedFor(notes, records, genesis, tree, { listed, reached: (number) => (at = number) });
      return { verdict: "redacted", records: leaves.length, failure: null, shortfall: null,
        ...redactedClaims({ leaves, lines, root, genesis, basis, notes, signed }) };
    } catch (error) {
      return failed(error, at);
    }
  };

  /** Checks the checkpoints of a redacted log; gives how many are signed by a key that is known from it. */
  const signedFor = async (notes, records, genesis, tree, { listed, reached }) => {
    const logKey = genesis && unhex(genesis.log_key);
    let before = null, signed = 0;
    for (const [number, note] of [...notes].sort(([a], [b]) => a - b)) {
      reached(number);
      const { text, name, blob } = partsOf(note ?? "");
      const checkpoint = checkpointOf(text), record = records.get(number) ?? null;
      const origin = genesis ? originOf(genesis) : (before?.origin ?? checkpoint.origin);
      check(name === origin && checkpoint.origin === origin, "seal/note", "the signature is for another log");
      check(checkpoint.size === number, "seal/size", "the signature is for another number of records");
      check(same(checkpoint.root, await tree.root(number)), "seal/root", "the checkpoint does not match the leaves: at least one was changed");
      if (record) {
        check(same(checkpoint.record, await ownLeaf(record)), "seal/self", "the record is not the signed one: a field was changed");
        const next = record.type === "close" ? null : unhex(record.next_key);
        check(sameOrNull(checkpoint.key, next), "seal/next-key", "the signature names another key for the next epoch than the record does");
      }
      const adjoins = sameOrNull(checkpoint.after, before?.digest ?? null);
      check(adjoins || !listed, "seal/after", "the signature does not follow that of the previous signed record");
      // Who signed depends on the type of the record. Of a removed one that is a seal or a close, or a recover.
      const epochKey = (adjoins && before?.key) || null, first = ["genesis", "recover"].includes(record?.type);
      const keys = record ? [first ? logKey : epochKey] : number ? [epochKey, logKey] : [logKey];
      const known = [];
      for (const key of keys.filter(Boolean)) if (same(await noteId(origin, 1, key), blob.subarray(0, 4))) known.push(key);
      check(known.length || keys.includes(null), "seal/key", "the checkpoint is signed by another key, or in another name");
      for (const key of known) {
        check(await signatureCounts(key, blob.subarray(4), label(text)), "seal/signature", "the signature of the checkpoint is wrong");
        signed += 1;
      }
      before = { ...checkpoint, digest: await sha256(label(text)) };
    }
    return signed;
  };

  const redactedClaims = ({ leaves, lines, root, genesis, basis, notes, signed }) => {
    const shown = [
      `consistent with a log of root ${hex(root)}: this is a redacted picture, not a record; ask for the log`,
      `${lines.length} of ${leaves.length} lines are here; each is the one of its leaf`,
    ];
    if (signed) shown.push(`${signed} of ${notes.size} checkpoints match the leaves, and are signed by a key that this picture names`);
    if (basis) shown.push(`the pinned key signed the trust root of this log, and the root authorises log key ${genesis.log_kid}`);
    const notShown = ["what the removed lines say, and that they are records at all"];
    if (!basis) notShown.push("who wrote this log: its first record, or a pinned key, is missing");
    notShown.push("everything that needs the whole log: clocks, epochs, gaps, the end");
    return { shown, notShown };
  };

  return { embedded, verifyLog, verifyRedacted, signerOf, signatureCounts };
})();
