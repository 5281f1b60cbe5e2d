/* The enforcement boundary: `enforce` decides one request and issues the permits that the decision grants. `boundary.py`. The structure
   contains everything of one session: the verified bundle, the session, the key of the permits, the gate. */
#ifndef RT_ENFORCEMENT_BOUNDARY_H
#define RT_ENFORCEMENT_BOUNDARY_H

#include "clock.h"
#include "decision/session.h"
#include "executor.h"
#include "kept.h"
#include "wire/attestation.h"
#include "wire/request.h"
#include "wire/response.h"

/* The keys that only a boundary has. */
typedef struct {
    uint8_t session[RT_KEY_BYTES];  /* of the permits: drawn for each start */
    uint8_t link[RT_KEY_BYTES];     /* of MAVLink's signatures */
    uint8_t boundary[RT_KEY_BYTES]; /* the seed of its own signing key, */
    uint8_t log[RT_KEY_BYTES];      /* and of the one that signs logs */
} rt_keys;

/* The configuration of a boundary. */
typedef struct {
    rt_keys *keys;
    rt_kept *kept;
    rt_bytes root, pinned; /* the signed trust root, and the key that pins it */
    rt_bytes vehicle;      /* the identity of this vehicle */
    bool signs;            /* the link has a key */
    bool has_key;          /* and the boundary has it */
    bool has_log_key;      /* it signs the log of a flight */
    const rt_preparation *settings, *owed; /* the parameters to set, and those owed to the vehicle; NULL if there are none */
    rt_now now;         /* by the machine's clock, with the error reported by the kernel; RT_UTC_UNKNOWN_US if it is not synchronised */
    int64_t stated_us;  /* the error of this clock as stated by an operator, -1 if not stated */
    rt_home home;       /* the place where it runs */
} rt_setup;

typedef struct {
    rt_keys *keys;
    rt_kept *kept;
    rt_root root;
    rt_bytes vehicle;
    bool loaded; /* a bundle is in force, */
    bool opened; /* and its mission was opened before this start: no step of it begins */
    bool to_keep; /* `kept` must be on the disk before the answer is sent */
    int64_t expires_us; /* UTC after which no step of the bundle is valid */
    rt_session session;
    rt_executor executor;
    rt_issuer issuer; /* of preparation permits */
    uint64_t serial;   /* of the next permit */
    int64_t version;   /* of the policy: fixed, a newer one comes with another bundle, after landing */
    int64_t now_us;    /* of the last request: time must not go back */
    rt_home home;      /* the place where it runs, as measured at the start */
    rt_clock clock;    /* its own clock, if it has one */
    bool dated;        /* whether the keys of the bundle were valid by that clock */
    uint64_t challenges; /* how many were drawn */
    bool ahead_known;
    int64_t ahead_us;  /* UTC minus monotonic time at the first request */
    rt_request asked;  /* the request under decision */
    rt_approval approvals[RT_MAX_ANSWERS];
    uint8_t bundle[RT_MAX_BUNDLE];
    uint8_t documents[1 + RT_MAX_REPLACEMENTS][RT_MAX_DOCUMENT]; /* the replacements in force, and one that is being received */
    uint32_t document_count;
    rt_chain chain;  /* its own evidence; */
    bool has_key, attests; /* it can sign that, for a session of this number, after the digest of the previous one */
    bool has_log_key, log_begun; /* it can sign the log of this flight, and has done so */
    int64_t attestation;
    uint8_t before[RT_DIGEST_BYTES];
    bool answered; /* the last answer about a step, for comparison with the next */
    int64_t last[5];
    uint64_t flights; /* how many began */
    uint32_t bundle_size, document_size; /* how much was transferred, of either */
} rt_boundary;

/* Begin, under a trust root that must be valid now. */
rt_refusal rt_boundary_begin(rt_boundary *boundary, const rt_setup *setup);

/* Open the transferred bundle, for a flight of this id, received now: its mission is opened, once. The bundle in force is dropped, even
   if the new one is refused; not while it flies. */
rt_refusal rt_load(rt_boundary *boundary, const uint8_t flight[RT_FLIGHT_BYTES], const rt_now *named, int64_t own_us);

/* Process the transferred document; the receipt goes into `out`, of 256 octets; returns its size. */
uint32_t rt_present(rt_boundary *boundary, const rt_now *now, int64_t released, int64_t own_us, uint8_t *out);

/* Whether something may fly: a command of the bundle in force was sent, by this boundary or an earlier one. */
bool rt_may_fly(const rt_boundary *boundary);

/* Nothing of the bundle in force was sent: its mission may be opened again. False if it was used, or nothing is in force. */
bool rt_give_back(rt_boundary *boundary);

/* Begin a session of the boundary's own evidence: the one after its stored session, or the proposed one with the digest of its
   predecessor, if its number is greater. False without a key, and on a second call. Then sign its state into `out` of RT_MAX_STATEMENT
   octets; 0 if nothing is signed. */
bool rt_attest(rt_boundary *boundary, int64_t session, const uint8_t before[RT_DIGEST_BYTES]);
uint32_t rt_attested(rt_boundary *boundary, const rt_now *named, int64_t own_us, bool final, uint8_t *out);

/* Sign the measurement of the home into `out` of RT_MAX_ATTESTATION octets, during a session of the evidence; 0 if nothing is signed. */
uint32_t rt_attest_home(const rt_boundary *boundary, uint8_t *out);

/* The source of the time of day, and its value: our own, or, if `own_us` is -1, the caller's. */
int64_t rt_own_now(const rt_boundary *boundary, const rt_now *named, int64_t own_us, rt_now *now);

/* Sign the checkpoint that begins the log of the flight in force, once; this key signs nothing else. */
rt_refusal rt_begin_log(rt_boundary *boundary, rt_bytes checkpoint, uint8_t signature[RT_SIGNATURE_BYTES]);

/* Decide one request into `out` of RT_MAX_RESPONSE octets; returns their number. Malformed bytes are refused. `own_us` is our own
   monotonic time, -1 if there is only the caller's. */
uint32_t rt_enforce(rt_boundary *boundary, rt_bytes request, int64_t own_us, uint8_t *out);

/* Whether a caller's monotonic time differs from ours by more than the delay of a message: nothing is decided ahead, or for a long past
   time. */
bool rt_is_apart(int64_t now_us, int64_t own_us);

#endif
