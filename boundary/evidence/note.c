#include "note.h"

#define ENCODED 44 /* characters of 32 octets in base64 */

/* The unread rest of a text; empty after a mismatch. */
typedef struct {
    rt_bytes left;
    bool fits;
} reader;

static void expect(reader *text, const uint8_t *octets, uint32_t size) {
    text->fits = text->fits && text->left.size >= size && memcmp(text->left.at, octets, size) == 0;
    if (text->fits) text->left = (rt_bytes){text->left.at + size, text->left.size - size};
}

#define EXPECT(text, literal) expect(text, (const uint8_t *)(literal), sizeof(literal) - 1)

static bool is_plain(uint8_t octet) {
    const bool letter = (octet >= 'a' && octet <= 'z') || (octet >= 'A' && octet <= 'Z');
    return letter || (octet >= '0' && octet <= '9') || octet == '_' || octet == '.' || octet == '-' || octet == '~';
}

/* The identity of a vehicle as it stands in an origin: `quote` of urllib.parse, nothing safe. */
static void expect_quoted(reader *text, rt_bytes words) {
    static const uint8_t digits[] = "0123456789ABCDEF";
    for (uint32_t at = 0; at < words.size; at++) {
        const uint8_t octet = words.at[at], quoted[] = {'%', digits[octet >> 4], digits[octet & 15]};
        if (is_plain(octet)) expect(text, &octet, 1);
        else expect(text, quoted, sizeof quoted);
    }
}

/* 0 to 63, or 64 for a character that is not base64. */
static uint32_t sextet(uint8_t octet) {
    static const uint8_t alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (uint32_t at = 0; at < 64; at++)
        if (alphabet[at] == octet) return at;
    return 64;
}

/* 32 octets in canonical base64. */
static void expect_digest(reader *text) {
    const uint8_t *at = text->left.at;
    text->fits = text->fits && text->left.size >= ENCODED && at[ENCODED - 1] == '=';
    for (uint32_t each = 0; text->fits && each < ENCODED - 1; each++) text->fits = sextet(at[each]) < 64;
    text->fits = text->fits && (sextet(at[ENCODED - 2]) & 3) == 0;
    if (text->fits) text->left = (rt_bytes){at + ENCODED, text->left.size - ENCODED};
}

bool rt_begins_log(rt_bytes text, rt_bytes vehicle, const uint8_t flight[RT_FLIGHT_BYTES]) {
    static const uint8_t digits[] = "0123456789abcdef";
    reader left = {text, true};
    EXPECT(&left, "rtshcua/log/");
    expect_quoted(&left, vehicle);
    EXPECT(&left, "/");
    for (uint32_t at = 0; at < RT_FLIGHT_BYTES; at++) {
        const uint8_t octet[] = {digits[flight[at] >> 4], digits[flight[at] & 15]};
        expect(&left, octet, sizeof octet);
    }
    EXPECT(&left, "\n0\n47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=\nrecord "); /* without records: SHA-256 of nothing */
    expect_digest(&left);
    EXPECT(&left, "\nkey ");
    expect_digest(&left);
    EXPECT(&left, "\n");
    return left.fits && left.left.size == 0;
}
