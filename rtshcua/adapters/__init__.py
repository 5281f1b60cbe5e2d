"""Everything that touches the world: vehicles over MAVLink (`vehicle`, `px4`, `ardupilot`), files, clocks."""
