"""What studies of robots on rails report, declared once."""

from __future__ import annotations

from results_schema.variable import outputs

RESULTS = outputs("""
    estimated_error | result | | optional nan float32 | estimated error of every result
        at any time, and of the largest values alone, over the largest length of a robot's error or the largest
        deflection of a rail; of steps, of what may be larger between these, of modes and of elements; of drives over
        the largest force or torque of the robot, held to no tolerance
    estimated_error_time | result | s | optional nan | time at which more modes or steps changed a result the most
        of whichever leaves the larger error, but for modes that the study fixes; NaN of stresses and drives
    steps_used | | | int32 | number of steps used
        over the whole time
    cycle_time | | s | | time at which all robots have done what they are told
    * | | | nan |
    error_moving | robot | m | | largest length of the error of the tool centre point while any of its joints moves
        NaN where none does
    error_working | robot | m | | largest length of the error of the tool centre point while the robot works
        NaN where it never does
    error_holding | robot | m | | largest length of the error of the tool centre point while it stands without work
        NaN where it never does
    beyond_rest_moving | robot | m | | largest length of what a tool is off from rest while any of its joints moves
        from where it would rest if all joints were held where they are told to be then; NaN where none moves
    beyond_rest_working | robot | m | | largest length of what a tool is off from rest while the robot works
        likewise; NaN where it never does
    beyond_rest_holding | robot | m | | largest length of what a tool is off from rest while it stands without work
        likewise; NaN where it never does
    beyond_linear | robot | | | what rails leave out that do not grow shorter as they bend, over the longest error
        of the tool; second order, in no estimated error
    drive_force_largest | robot joint | N | | largest force of the drive of a joint that slides
        of its controller too; not that of a blow; NaN of joints that turn or are not there
    drive_torque_largest | robot joint | N m | | largest torque of the drive of a joint that turns
        likewise; NaN of joints that slide or are not there
    at_rest | robot | | | part of the time for which a tool is where it would rest
        within the tolerance, of its largest error
    * | | | |
    error_largest | robot component | m | | largest component of the error of the tool centre point
        actual less planned
    error_largest_time | robot | s | | time of the longest error of the tool centre point
    error_at_start | robot component | m | | error of the tool centre point at time 0, on unloaded rails
        from which errors count, unless the question says otherwise
    deflection_largest | rail | m | | largest deflection of a rail under a robot, down > 0
    stress_largest | rail | Pa | nan | largest bending stress of a rail, in its extreme fibres
        NaN where a section has no fibre distances
    rail_force_largest | robot | N | | largest vertical force of a robot on one of its rails
    * | | | optional history |
    tool_centre_point | station robot component | m | | planned place of the tool centre point
    tool_centre_point_error | station robot component | m | | error of the tool centre point: actual less planned
    rail_deflection | station rail rail_end | m | gaps | deflection of a rail by its modes, down > 0
        NaN beyond the places that a rail has
    * | | | optional alone nan |
    error_without | still robot | m | | largest length of the error of a tool while one robot stands still
        where it starts; of the scene without sweep
    error_by_modes | mode_count robot | | | what a number of modes of every rail changes the errors of tools by
        the largest difference, over the longest error of the tool; of the scene without sweep
    error_by_modes_doubt | robot | | | estimated error of the march that numbers of modes are compared with
        over the longest error of the tool
    rail_place | rail rail_end | m | | place along a rail
    * | | | |
    robot | | | axis str | robot
    still | | | axis str | robot that stands still
    joint | | | axis str | joint
        from the rail outward
    rail | | | axis str | body that robots ride
    rail_end | | | axis | place along a rail
        its number
    component | | | axis str | component of the vector
""")
