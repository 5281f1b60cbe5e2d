/* Signed documents for a vehicle in flight: the common part of approvals, recalls, replacements and cancellations. */
#ifndef RT_WIRE_DOCUMENT_H
#define RT_WIRE_DOCUMENT_H

#include "bundle.h"

#define RT_MAX_WITHOUT_MISSION (1u << 11)
#define RT_MAX_LIFE_US 3600000000LL

/* The flight that a document must be for. */
typedef struct {
    const rt_root *root;
    rt_bytes vehicle, flight;
    rt_now now;
    const rt_bundle *bundle; /* what is in force, after a replacement too */
    /* the digests of the first mission and its replacements */
    const uint8_t (*missions)[RT_DIGEST_BYTES];
    uint32_t mission_count;
    const rt_bytes *replaced; /* the invocations that were in force and no longer are, each as it was signed */
    uint32_t replaced_count;
} rt_flight;

/* The kind of a document, unverified: `document.kind_of`. */
rt_refusal rt_kind_of(rt_bytes document, const rt_artefact **kind);

/* The content of a document, if a key that the root trusts for the duty signed it and the root has certainly not expired: `body` is its
   array of fields. See `open_document`. */
rt_refusal rt_open_document(const rt_flight *flight, rt_bytes document, const rt_artefact *kind, int64_t duty, rt_verified *opened,
                            rt_cursor *body);

/* The checks of `document.py`. */
rt_refusal rt_check_times(const rt_flight *flight, int64_t issued_at_us, int64_t expires_at_us);
rt_refusal rt_check_key(const rt_flight *flight, const rt_key *key);
bool rt_is_of_flight(const rt_flight *flight, rt_bytes mission); /* whether it is the digest of one of its missions */

/* The latest possible UTC. */
static inline int64_t rt_latest_utc_us(const rt_flight *flight) { return flight->now.utc_us + flight->now.utc_error_us; }

#endif
