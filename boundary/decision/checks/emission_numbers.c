/* The commands to payload that a contract emits: `decision/checks/emission_numbers.py`. What may be emitted is written down here again, apart from
   the gate's list. */
#include "../parts.h"

#include "mavlink/parameters.h"

#define PARAMETERS 7
#define FIRST_OF_PLACE 5
#define HALF_TURN 1800000000LL

enum { SERVO = 183, ROI_LOCATION = 195, MOUNT_CONTROL = 205, DIGICAM = 203, PITCHYAW = 1000, IMAGE_START = 2000 };

static bool for_camera(int64_t command) {
    switch (command) {
    case DIGICAM: case 206: case 530: case 531: case 532: case IMAGE_START: case 2001: case 2003: case 2500: case 2501: return true;
    default: return false;
    }
}

static bool for_gimbal(int64_t command) {
    return command == ROI_LOCATION || command == 197 || command == MOUNT_CONTROL || command == PITCHYAW || command == 1001;
}

bool rt_may_be_emitted(int64_t command, int64_t addressee) {
    switch (addressee) {
    case RT_CAMERA: return for_camera(command);
    case RT_GIMBAL: return for_gimbal(command);
    case RT_AUTOPILOT:
        return for_camera(command) || for_gimbal(command) || command == SERVO || command == 211 || command == 42600;
    default: return false;
    }
}

static bool is_kind(const uint8_t cells[RT_MAX_CELLS], int64_t cell, uint8_t kind) {
    return rt_within(cell, 0, RT_MAX_CELLS - 1) && cells[cell] == kind;
}

static bool check_parameter(const rt_emission_parameter *parameter, uint32_t number, int64_t command, const uint8_t cells[RT_MAX_CELLS]) {
    const bool of_place = command == ROI_LOCATION, placed = of_place && number >= FIRST_OF_PLACE;
    const int64_t cell = parameter->cell, value = parameter->value;
    switch (parameter->origin) {
    case RT_CONSTANT:
        return cell == -1 && rt_within(value, 0, UINT32_MAX) && (value == RT_NAN || rt_is_finite((uint32_t)value)) && !placed;
    case RT_OF_ARGUMENT:
        return is_kind(cells, cell, RT_QUANTITY) && rt_within(value, 1, RT_MAX_DIVISOR) && !placed;
    case RT_LATITUDE:
    case RT_LONGITUDE:
        return of_place && number == (parameter->origin == RT_LATITUDE ? 5 : 6) && is_kind(cells, cell, RT_PLACE) && value == 0;
    case RT_HEIGHT:
        if (!of_place || number != PARAMETERS) return false;
        return cell == -1 ? rt_within(value, RT_LOWEST, RT_HIGHEST) : is_kind(cells, cell, RT_QUANTITY) && value == 0;
    default:
        return false;
    }
}

static bool check_moment(const rt_emission *emission, int64_t motion, const rt_vehicle *vehicle) {
    const int64_t amount = emission->amount;
    switch (emission->moment) {
    case RT_AT_BEGIN:
    case RT_AT_END: return amount == 0;
    case RT_AT_TURN: return amount == 0 && motion == RT_COVER;
    case RT_AT_WAYPOINT: return amount == 0 && (motion == RT_COVER || motion == RT_FLY);
    case RT_BY_DISTANCE:
        return rt_within(amount, 1, RT_MAX_COORDINATE) && amount * RT_SECOND / rt_max(vehicle->speed, 1) >= RT_MIN_EMISSION_INTERVAL;
    case RT_BY_TIME: return rt_within(amount, RT_MIN_EMISSION_INTERVAL, RT_MAX_DURATION);
    default: return false;
    }
}

static bool takes_pictures(int64_t command) {
    return command == DIGICAM || command == IMAGE_START || command == 206 || command == 2003;
}

static bool check_success(const rt_emission *emission) {
    const int64_t command = emission->command, bound = emission->bound;
    if (!rt_within(emission->within_us, 1, RT_MAX_PAYLOAD_WAIT) || !rt_within(emission->required, 0, 1)) return false;
    switch (emission->success) {
    case RT_BY_ACKNOWLEDGEMENT: return bound == 0;
    case RT_BY_IMAGE: return bound == 0 && (command == DIGICAM || command == IMAGE_START);
    case RT_BY_ATTITUDE: return rt_within(bound, 1, HALF_TURN) && (command == MOUNT_CONTROL || command == PITCHYAW);
    case RT_BY_ALL_IMAGES: return bound == 0 && takes_pictures(command);
    default: return false;
    }
}

static bool is_free(const rt_emission_parameter *channel, const rt_vehicle *vehicle) {
    rt_list servos = vehicle->servos;
    int64_t servo;
    while (rt_next_int(&servos, &servo))
        if (channel->origin == RT_CONSTANT && rt_is_whole((uint32_t)channel->value, servo)) return true;
    return false;
}

static bool check_emission(const rt_emission *emission, const rt_contract *contract, const rt_vehicle *vehicle,
                           const uint8_t cells[RT_MAX_CELLS]) {
    rt_list left = emission->parameters;
    rt_emission_parameter parameter;
    if (!rt_may_be_emitted(emission->command, emission->addressee) || left.count != PARAMETERS) return false;
    for (uint32_t number = 1; rt_next_emission_parameter(&left, &parameter); number++) {
        if (!check_parameter(&parameter, number, emission->command, cells)) return false;
        if (number == 1 && emission->command == SERVO && !is_free(&parameter, vehicle)) return false;
    }
    return check_moment(emission, contract->motion.kind, vehicle) && check_success(emission);
}

bool rt_check_emissions(const rt_contract *contract, const rt_vehicle *vehicle, const uint8_t cells[RT_MAX_CELLS]) {
    rt_list left = contract->emits;
    rt_emission emission;
    if (left.count > RT_MAX_EMISSIONS) return false;
    while (rt_next_emission(&left, &emission))
        if (!check_emission(&emission, contract, vehicle, cells)) return false;
    return true;
}

bool rt_check_servos(const rt_vehicle *vehicle) {
    rt_list left = vehicle->servos;
    int64_t servo, before = 0;
    for (; rt_next_int(&left, &servo); before = servo)
        if (!rt_within(servo, before + 1, RT_MAX_SERVOS)) return false;
    return true;
}
