"""The vehicle of a scenario: its own fence holds the mission and is not wider."""

from msgspec.structs import replace

from reference import payload_case
from reference.deciding import program
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect, enums
from rtshcua.model.flat.contract import Addressee
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.simulation.config import AutopilotKind
from rtshcua.virtual.fitting import fitting, with_room


def standard() -> tuple[Policy, Mission]:
    compiled = compile_program(
        program('import "lib:missions/standard.rts"'), dialect.load(), mission="standard", issued_at_us=5
    )
    assert compiled.policy is not None
    assert compiled.mission is not None
    return compiled.policy, compiled.mission


def test_own_fence_is_widened_to_hold_the_mission() -> None:
    policy, mission = standard()
    copter = fitting(policy, flavour=AutopilotKind.ARDUPILOT)
    assert with_room(copter, policy, mission.invocations) == copter
    step = mission.invocations[1]
    far = replace(step, plan=replace(step.plan, path=(300_000, 400_000), altitude=120_000))
    room = (policy.vehicle.position_error + policy.vehicle.home_within) // 1_000
    set_by_its_owner = {"FENCE_RADIUS": 500 + room, "FENCE_ALT_MAX": 120 + room}
    assert dict(with_room(copter, policy, (far,)).parameters) == set_by_its_owner
    px4 = fitting(policy)
    assert with_room(px4, policy, (far,)) == px4


def test_a_vehicle_has_the_camera_and_the_gimbal_that_its_contracts_command() -> None:
    for command, to, fitted in (
        (enums.MAV_CMD_IMAGE_START_CAPTURE, Addressee.CAMERA, (True, False)),
        (enums.MAV_CMD_DO_DIGICAM_CONTROL, Addressee.VEHICLE, (True, False)),
        (enums.MAV_CMD_SET_CAMERA_ZOOM, Addressee.CAMERA, (True, False)),
        (enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, Addressee.GIMBAL, (False, True)),
        (enums.MAV_CMD_DO_MOUNT_CONTROL, Addressee.VEHICLE, (False, True)),
        (enums.MAV_CMD_DO_GRIPPER, Addressee.VEHICLE, (False, False)),
    ):
        contract = payload_case.contract((payload_case.emission(command, to=to),))
        config = fitting(payload_case.policy(of=contract))
        assert (config.camera, config.gimbal) == fitted, command
        assert fitting(payload_case.policy(of=contract), camera=False).camera is False
