/* Frama-C's Eva runs this: the tables of a policy, a mission, and the items of their lists, for any input. */
#include "reader.h"
#include "wire/flat.h"

static rt_policy policy;
static rt_mission mission;
static rt_invocation invocation;

/* Any octets, well-formed or not. */
static rt_list list(void) {
    ANY(input);
    return (rt_list){input + SIZE(BYTES), input + SIZE(BYTES), SIZE(UINT32_MAX)};
}

int main(void) {
    rt_bytes data = {input, SIZE(BYTES)}, text;
    rt_list items = list();
    rt_clause clause;
    rt_link link;
    rt_parameter parameter;
    rt_signal_source source;
    rt_left_out left_out;
    rt_emission emission;
    rt_emission_parameter emission_parameter;
    int64_t number;
    switch (Frama_C_interval(0, 12)) {
    case 0: return rt_read_policy(data, &policy) != NULL;
    case 1: return rt_read_mission(data, &mission) != NULL;
    case 2: return rt_next_int(&items, &number);
    case 3: return rt_next_text(&items, &text);
    case 4: return rt_next_clause(&items, &clause);
    case 5: return rt_next_link(&items, &link);
    case 6: return rt_next_parameter(&items, &parameter);
    case 7: return rt_next_source(&items, &source);
    case 8: return rt_next_left_out(&items, &left_out);
    case 9: return rt_next_emission(&items, &emission);
    case 10: return rt_next_emission_parameter(&items, &emission_parameter);
    case 11: rt_read_invocation(data, &invocation); return 0;
    default: return rt_holds(items, rt_int_at(items, SIZE(UINT32_MAX)));
    }
}
