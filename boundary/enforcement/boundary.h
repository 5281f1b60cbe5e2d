/* The enforcement boundary: `enforce` decides one request and issues what the decision grants. `boundary.py`. Everything that one
   session holds is in here: the verified bundle, the session, the key of the permits, the gate. */
#ifndef RT_ENFORCEMENT_BOUNDARY_H
#define RT_ENFORCEMENT_BOUNDARY_H

#include "clock.h"
#include "decision/session.h"
#include "executor.h"
#include "kept.h"
#include "wire/request.h"
#include "wire/response.h"

/* The keys that only a boundary has. */
typedef struct {
    uint8_t session[RT_KEY_BYTES];  /* of the permits: drawn for each start */
    uint8_t link[RT_KEY_BYTES];     /* of MAVLink's signatures */
    uint8_t boundary[RT_KEY_BYTES]; /* the seed of its own signing key, */
    uint8_t log[RT_KEY_BYTES];      /* and of the one that signs logs */
} rt_keys;

/* What a boundary is given when it begins. */
typedef struct {
    rt_keys *keys;
    rt_kept *kept;
    rt_bytes root, pinned; /* the signed trust root, and the key that it is pinned by */
    rt_bytes vehicle;      /* the identity of the one that we are on */
    bool signs;            /* the link has a key */
    bool has_key;          /* and so has the boundary itself */
    bool has_log_key;      /* it signs the log of a flight */
    const rt_preparation *settings, *owed; /* what is set of the vehicle, and what is owed to it; NULL for nothing */
    rt_now now;         /* by the machine's clock; its error as the kernel says it, RT_UTC_UNKNOWN_US where it does not */
    int64_t stated_us;  /* what an operator says that this clock is off by at most, -1 for nothing */
} rt_setup;

typedef struct {
    rt_keys *keys;
    rt_kept *kept;
    rt_root root;
    rt_bytes vehicle;
    bool loaded; /* a bundle is in force, */
    bool opened; /* and its mission was opened before this start: no step of it begins */
    bool to_keep; /* `kept` must be on the disk before anybody learns what was answered */
    int64_t expires_us; /* when no step of the bundle is fresh any more, UTC */
    rt_session session;
    rt_executor executor;
    rt_issuer issuer; /* of preparation permits */
    uint64_t serial;   /* of the next permit */
    int64_t version;   /* of the policy: latched, a newer one comes with another bundle, after landing */
    int64_t now_us;    /* of the last request: time does not go back */
    rt_clock clock;    /* its own, where it has one */
    bool dated;        /* whether by that clock the keys of the bundle were good */
    uint64_t challenges; /* how many were drawn */
    bool ahead_known;
    int64_t ahead_us;  /* UTC less monotonic time, as it was first told */
    rt_request asked;  /* the request that is being decided */
    rt_approval approvals[RT_MAX_ANSWERS];
    uint8_t bundle[RT_MAX_BUNDLE];
    uint8_t documents[1 + RT_MAX_REPLACEMENTS][RT_MAX_DOCUMENT]; /* the replacements that are in force, and one that arrives */
    uint32_t document_count;
    rt_chain chain;  /* its own evidence; */
    bool has_key, attests; /* it may sign that, and does so for a session of this number, after the digest of the one before */
    bool has_log_key, log_begun; /* it may sign the log of this flight, and has done so */
    int64_t attestation;
    uint8_t before[RT_DIGEST_BYTES];
    bool answered; /* the last answer about a step, as far as one that equals it is counted */
    int64_t last[5];
    uint64_t flights; /* how many began */
    uint32_t bundle_size, document_size; /* how much was handed over, of either */
} rt_boundary;

/* Begin, under a trust root that must be good now. */
rt_refusal rt_boundary_begin(rt_boundary *boundary, const rt_setup *setup);

/* Open the bundle that was handed over, for a flight of this id, received now: its mission is opened, once. What is in force is
   given up, also where the bundle is refused; not while something of it flies. */
rt_refusal rt_load(rt_boundary *boundary, const uint8_t flight[RT_FLIGHT_BYTES], const rt_now *named, int64_t own_us);

/* Take in the document that was handed over; its receipt goes into `out`, of 256 octets; how many there are. */
uint32_t rt_present(rt_boundary *boundary, const rt_now *now, int64_t released, int64_t own_us, uint8_t *out);

/* Whether something may fly: of what is in force something was sent, now or by a boundary before this one. */
bool rt_may_fly(const rt_boundary *boundary);

/* Of what is in force nothing was sent: its mission may be opened again. False where it was used, or nothing is in force. */
bool rt_give_back(rt_boundary *boundary);

/* Begin a session of the boundary's own evidence: the one behind that which it kept, or the one that is proposed with the digest of
   the one before, where that has a greater number. False without a key, and for a second time. Then sign how far it got into `out` of RT_MAX_STATEMENT octets; 0 where nothing is signed. */
bool rt_attest(rt_boundary *boundary, int64_t session, const uint8_t before[RT_DIGEST_BYTES]);
uint32_t rt_attested(rt_boundary *boundary, const rt_now *named, int64_t own_us, bool final, uint8_t *out);

/* Where the time of day is from, and what it is by it: our own, or, where `own_us` is -1, what a caller names. */
int64_t rt_own_now(const rt_boundary *boundary, const rt_now *named, int64_t own_us, rt_now *now);

/* Sign the checkpoint that begins the log of the flight that is in force, once; nothing else is signed with this key. */
rt_refusal rt_begin_log(rt_boundary *boundary, rt_bytes checkpoint, uint8_t signature[RT_SIGNATURE_BYTES]);

/* Decide one request into `out` of RT_MAX_RESPONSE octets; answers how many there are. Hostile bytes get a refusal. `own_us` is our
   own monotonic time, -1 where the caller's is the only one. */
uint32_t rt_enforce(rt_boundary *boundary, rt_bytes request, int64_t own_us, uint8_t *out);

/* Whether a caller's monotonic time is further from ours than a message takes: nothing is decided ahead, or by what is long past. */
bool rt_is_apart(int64_t now_us, int64_t own_us);

#endif
