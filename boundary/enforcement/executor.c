#include "executor.h"

#include "wire/octets.h"

#define UNTOUCHED (RT_DEGRADE_LINK - 1)
#define ALWAYS INT64_MAX /* us */

void rt_executor_begin(rt_executor *executor, const uint8_t key[RT_KEY_BYTES], const rt_policy *policy, const rt_mission *mission,
                       uint64_t first) {
    const rt_signed_link signer = executor->gate.signer; /* the link stays as it is */
    const bool signs = executor->gate.signs;
    rt_chain *chain = executor->gate.chain;
    uint8_t prepared[sizeof executor->prepared]; /* and so do the serials of preparations, which are never sealed again */
    memcpy(prepared, executor->prepared, sizeof prepared);
    memset(executor, 0, sizeof *executor);
    executor->gate.signer = signer;
    executor->gate.signs = signs;
    executor->gate.chain = chain;
    memcpy(executor->prepared, prepared, sizeof prepared);
    memcpy(executor->key, key, RT_KEY_BYTES);
    executor->policy = policy;
    executor->mission = mission;
    executor->first = first;
    executor->step = executor->before = executor->fallback_step = -1;
    executor->fallback_link = executor->contingency = UNTOUCHED;
}

static void of_link(const rt_policy *policy, const rt_link *link, rt_command *command) {
    const rt_contract *contract = &policy->contracts[link->skill];
    const rt_motion *motion = &contract->motion;
    command->kind = motion->kind;
    command->altitude = motion->altitude < 0 ? 0 : rt_int_at(link->arguments, (uint32_t)motion->altitude);
    command->speed = motion->speed < 0 ? 0 : rt_int_at(link->arguments, (uint32_t)motion->speed);
    if (motion->kind != RT_FLY)
        return;
    rt_list left = contract->parameters;
    rt_parameter parameter;
    while (rt_next_parameter(&left, &parameter))
        if (parameter.kind == RT_PLACE) {
            command->has_place = true;
            command->place[0] = rt_int_at(link->arguments, (uint32_t)parameter.cell);
            command->place[1] = rt_int_at(link->arguments, (uint32_t)parameter.cell + 1);
            return;
        }
}

/* The command of a step or a link; false for one that is not in the bundle. */
static bool command_of(const rt_executor *executor, const rt_permit *permit, rt_command *command) {
    const rt_policy *policy = executor->policy;
    rt_invocation invocation;
    memset(command, 0, sizeof *command);
    command->token = permit->serial;
    command->projection = policy->projection;
    if (permit->kind == RT_CONTINGENCY_LINK) {
        if (permit->link < 0 || permit->link >= policy->contingency_count)
            return false;
        of_link(policy, &policy->contingency[permit->link], command);
        return true;
    }
    if (permit->step < 0 || permit->step >= executor->mission->invocation_count)
        return false;
    rt_invocation_at(executor->mission, (uint32_t)permit->step, &invocation);
    if (permit->kind == RT_STEP) {
        command->kind = invocation.plan.kind;
        command->altitude = invocation.plan.altitude;
        command->speed = invocation.plan.speed;
        command->path = invocation.plan.path;
        command->heights = invocation.plan.heights;
        command->headings = invocation.plan.headings;
        rt_payload_of(&invocation, policy, command);
        return true;
    }
    int64_t rule = -1 - permit->link, number = permit->link;
    if (rule >= 0) {
        if (rule >= policy->rule_count || !policy->rules[rule].has_target)
            return false;
        of_link(policy, &policy->rules[rule].target, command);
        return true;
    }
    rt_list chain = invocation.contract.fallback;
    rt_link link;
    while (rt_next_link(&chain, &link))
        if (number-- == 0) {
            of_link(policy, &link, command);
            return true;
        }
    return false;
}

/* The place of a serial among the used ones, present or not. */
static uint32_t place_of(const rt_executor *executor, uint64_t serial) {
    uint32_t low = 0, high = executor->used_count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (executor->used[middle] < serial)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static bool is_used(const rt_executor *executor, uint64_t serial) {
    uint32_t at = place_of(executor, serial);
    return at < executor->used_count && executor->used[at] == serial;
}

static void use(rt_executor *executor, uint64_t serial) {
    uint32_t at = place_of(executor, serial);
    for (uint32_t later = executor->used_count++; later > at; later--)
        executor->used[later] = executor->used[later - 1];
    executor->used[at] = serial;
}

/* The position of a fallback permit in its chain: a degrade rule's target comes before the first link. */
static int64_t position(const rt_permit *permit) {
    return permit->link > RT_DEGRADE_LINK ? permit->link : RT_DEGRADE_LINK;
}

static rt_refusal refuse_step(const rt_executor *executor, const rt_permit *permit) {
    if (executor->homeward || executor->called_off)
        return "permit/mission-over";
    if (executor->running || permit->step <= executor->step)
        return "permit/out-of-turn";
    return NULL;
}

static rt_refusal refuse_link(const rt_executor *executor, const rt_permit *permit) {
    if (permit->kind == RT_CONTINGENCY_LINK) /* holds may be repeated; once a link brings the vehicle home or down, the chain continues
                                                from there */
        return executor->final && permit->link < executor->contingency ? "permit/backwards" : NULL;
    if (permit->step < executor->step)
        return "permit/lapsed";
    if (executor->final || (permit->step == executor->fallback_step && position(permit) <= executor->fallback_link))
        return "permit/backwards";
    return NULL;
}

static void follow(rt_executor *executor, const rt_permit *permit, int64_t motion) {
    bool homeward = motion == RT_HOME || motion == RT_LAND;
    executor->running = false;
    executor->homeward = executor->homeward || homeward;
    if (permit->kind == RT_CONTINGENCY_LINK) {
        executor->contingency = permit->link;
        executor->final = executor->final || homeward;
    } else {
        executor->fallback_step = permit->step;
        executor->fallback_link = position(permit);
    }
}

/* Why a permit is refused at a monotonic time; NULL if its command may be sent. */
static rt_refusal refuse(const rt_executor *executor, const rt_permit *permit, int64_t now_us, rt_command *command) {
    if (executor->gate.chain->over)
        return "permit/session-over";
    if (is_used(executor, permit->serial))
        return "permit/used";
    if (now_us > permit->not_after_us)
        return "permit/late";
    rt_refusal refused = permit->kind == RT_STEP ? refuse_step(executor, permit) : refuse_link(executor, permit);
    if (refused != NULL)
        return refused;
    if (executor->used_count == RT_MAX_DISPATCHED || !command_of(executor, permit, command))
        return "permit/not-covered";
    return NULL;
}

static rt_refusal dispatch(rt_executor *executor, const rt_permit *permit, int64_t now_us) {
    rt_command command;
    rt_refusal refused = refuse(executor, permit, now_us, &command);
    if (refused != NULL)
        return refused;
    use(executor, permit->serial);
    if (permit->kind == RT_STEP) {
        executor->before = executor->step;
        executor->before_serial = executor->serial;
        executor->step = permit->step;
        executor->serial = permit->serial;
        executor->running = true;
        if (!executor->flies) {
            executor->flies = true;
            executor->flight = permit->serial;
        }
    } else {
        follow(executor, permit, command.kind);
    }
    executor->last = permit->serial;
    uint8_t payload[21], *at = payload;
    rt_put(&at, (uint64_t)permit->kind, 1);
    rt_put(&at, (uint64_t)permit->step, 2);
    rt_put(&at, (uint64_t)(permit->link > RT_DEGRADE_LINK ? permit->link : RT_DEGRADE_LINK), 2);
    rt_put(&at, permit->serial, 8);
    rt_put(&at, (uint64_t)now_us, 8);
    rt_chain_add(executor->gate.chain, RT_TAG_SENT, (rt_bytes){payload, sizeof payload}, (rt_bytes){NULL, 0});
    rt_gate_open(&executor->gate, &command, permit->not_after_us);
    return NULL;
}

/* A refused permit: why, at a monotonic time. */
static rt_refusal chained(rt_executor *executor, rt_refusal refused, int64_t now_us) {
    uint8_t time[8], *at = time;
    if (refused == NULL) return NULL;
    rt_put(&at, (uint64_t)now_us, 8);
    rt_chain_add(executor->gate.chain, RT_TAG_REFUSED, (rt_bytes){time, sizeof time}, rt_words(refused));
    return refused;
}

/* Whether this session sealed it. */
static bool is_ours(const rt_executor *executor, rt_bytes sealed, rt_permit *permit) {
    return rt_open_permit(sealed, executor->key, permit) && permit->serial >= executor->first;
}

rt_refusal rt_dispatch(rt_executor *executor, rt_bytes sealed, int64_t now_us, rt_permit *permit) {
    bool ours = is_ours(executor, sealed, permit);
    return chained(executor, ours ? dispatch(executor, permit, now_us) : "permit/forged", now_us);
}

/* The command that a standing permit covers for a link; or why it is refused. */
static rt_refusal standing_for(const rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, rt_permit *permit) {
    rt_permit standing;
    if (!is_ours(executor, sealed, &standing))
        return "permit/forged";
    bool fallback = kind == RT_FALLBACK_LINK;
    if (link < 0 || link >= (fallback ? standing.fallbacks : standing.contingencies))
        return "permit/not-covered";
    /* not sent, or withdrawn, followed by another step, or landed since */
    bool lapsed = !executor->flies || !is_used(executor, standing.serial) || standing.serial < executor->flight ||
                  standing.serial > executor->serial;
    if (standing.kind != RT_STEP || lapsed || (fallback && standing.serial != executor->serial))
        return "permit/lapsed";
    uint64_t serial = standing.serial + 1 + (uint64_t)link + (fallback ? 0 : (uint64_t)standing.fallbacks);
    if (!fallback && link == standing.contingencies - 1) {
        uint64_t end = serial + RT_AGAIN;
        while (serial < end && is_used(executor, serial))
            serial++;
    }
    *permit = (rt_permit){kind, fallback ? standing.step : -1, link, serial, 0, 0, ALWAYS};
    return NULL;
}

static rt_refusal stand_in(rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us, rt_permit *permit) {
    rt_refusal refused = standing_for(executor, sealed, kind, link, permit);
    return refused != NULL ? refused : dispatch(executor, permit, now_us);
}

rt_refusal rt_stand_in(rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us, rt_permit *permit) {
    return chained(executor, stand_in(executor, sealed, kind, link, now_us, permit), now_us);
}

rt_refusal rt_dispatch_apart(rt_executor *executor, int64_t now_us) { return chained(executor, "time-apart", now_us); }

static rt_refusal withdraw(rt_executor *executor, rt_session *session, const rt_permit *permit) {
    if (executor->gate.chain->over) return "permit/session-over";
    if (permit->kind != RT_STEP) return "permit/sent";
    bool used = is_used(executor, permit->serial);
    if (used && (permit->serial != executor->serial || permit->serial != executor->last)) return "permit/sent";
    if (used ? executor->gate.let_out : permit->step <= executor->step) return "permit/sent";
    if (executor->used_count == RT_MAX_DISPATCHED || !rt_session_give_back(session, permit->step)) return "permit/sent";
    if (!used) {
        use(executor, permit->serial);
        return NULL;
    }
    executor->step = executor->before;
    executor->serial = executor->before_serial;
    executor->running = false;
    if (executor->flight == permit->serial) executor->flies = false;
    rt_gate_close(&executor->gate);
    return NULL;
}

rt_refusal rt_withdraw(rt_executor *executor, rt_session *session, rt_bytes sealed, int64_t now_us) {
    rt_permit permit;
    rt_refusal refused = is_ours(executor, sealed, &permit) ? withdraw(executor, session, &permit) : "permit/forged";
    chained(executor, refused == NULL ? "permit/unsent" : refused, now_us);
    return refused;
}

static rt_refusal unprepared(const rt_executor *executor, const rt_preparation *permit, int64_t now_us) {
    if (executor->gate.chain->over) return "permit/session-over";
    if (executor->prepared[permit->serial / 8] >> permit->serial % 8 & 1) return "permit/used";
    if (now_us > permit->not_after_us) return "permit/late";
    return rt_gate_stands(&executor->gate, now_us) ? NULL : "permit/not-down";
}

static rt_refusal chained_unprepared(rt_executor *executor, rt_refusal refused) {
    rt_chain_add(executor->gate.chain, RT_TAG_UNPREPARED, rt_words(refused), (rt_bytes){NULL, 0});
    return refused;
}

rt_refusal rt_prepare_apart(rt_executor *executor) { return chained_unprepared(executor, "time-apart"); }

rt_refusal rt_executor_prepare(rt_executor *executor, rt_bytes sealed, int64_t now_us) {
    rt_preparation permit;
    const rt_bytes nothing = {NULL, 0};
    const bool ours = rt_open_preparation(sealed, executor->key, &permit) && permit.serial < RT_MOST_PREPARATIONS;
    rt_refusal refused = ours ? unprepared(executor, &permit, now_us) : "permit/forged";
    if (refused != NULL) return chained_unprepared(executor, refused);
    uint8_t payload[2 + RT_MAX_WRITES * 24], *at = payload;
    rt_put(&at, permit.restoring, 1);
    rt_put(&at, permit.count, 1);
    at += rt_put_writes(&permit, at);
    rt_chain_add(executor->gate.chain, RT_TAG_PREPARED, (rt_bytes){payload, (uint32_t)(at - payload)}, nothing);
    executor->prepared[permit.serial / 8] |= (uint8_t)(1 << permit.serial % 8);
    rt_gate_prepare(&executor->gate, &permit);
    return NULL;
}

rt_refusal rt_may_stand_in(const rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us,
                           rt_permit *permit, rt_command *command) {
    rt_refusal refused = standing_for(executor, sealed, kind, link, permit);
    return refused != NULL ? refused : refuse(executor, permit, now_us, command);
}

void rt_ended(rt_executor *executor) {
    executor->running = false;
    rt_gate_close(&executor->gate);
}

void rt_ended_command(rt_executor *executor, uint64_t token) {
    if (token == executor->last)
        rt_ended(executor);
}

void rt_landed(rt_executor *executor) {
    executor->running = executor->flies = false;
    rt_gate_close(&executor->gate);
}

void rt_release(rt_executor *executor) { rt_gate_close(&executor->gate); }
