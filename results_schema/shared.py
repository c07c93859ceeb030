"""The outputs that kinds of study share: coordinates, what every kind has, marches, and the groups of an archive."""

from results_schema.status import Fidelity, SchemeUsed, Status
from results_schema.variable import AXES, EVERY_KIND, declare, outputs

declare(
    AXES,
    *outputs("""
        speed_ratio | | | optional | speed ratio
            speed over omega_1 L / pi, L the length of the track
        mass_ratio | | | optional | mass ratio
            carriage mass over body mass
        position | | m | axis | position
            of the first carriage, along its track
        phase | | | axis | phase of the last cycle
            0 to 1, 0 where the motion's formula starts
        station | | | axis int64 | recorded instant
            its number
        elapsed | position/phase/station | s | optional history | time since the start
        history | | | axis int64 | variant
            its flat number in the sweep's grid, last axis fastest
        variant | | | axis int64 | variant
            its number in a sampled or zipped sweep
        direction | | | axis str | direction of travel
            forward is from start to end
        sensor | | | axis str | sensor
        sensor_unit | sensor | | optional alone str | unit of the sensor
        result | | | axis str | reported number
        result_unit | result | | optional alone str | unit of the result
            where an archive keeps cells in place of variants
        swept | | | axis str | swept number
        swept_unit | swept | | optional alone str | unit of the swept number
        status_name | | | axis str | status
        percent | | percent | axis | part of the variants
            of those that have no larger value
        peak | | | axis int64 | peak
            its number in the cycle
        mode | | | axis int64 | mode
            its number, from 1
        body_mode | | | axis int64 | mode of the body
            its number, from 1
        track_position | | m | axis | place along the track
        sample | | | axis int64 | variant
            flat number of one that was run again
        scheme | | | axis str | time integration scheme
        step_count | | | axis int64 | steps
            over one passage or cycle
        mode_count | | | axis int64 | number of modes
        quantity | | | axis str | measured quantity
        relative_step | | | axis | omega_1 times time step
    """),
)

declare(
    EVERY_KIND,
    *outputs(
        """
        status | | - | int8 | status of the variant
            the most serious that applies
        fidelity_used | | - | int8 | model used
            the cheapest that holds the tolerance
        modes_used | | | int32 | number of modes used
            0 where results are static: by exact influence lines
        steps_used | | | int32 | number of steps used
            steps over one passage or cycle
        scheme_used | | - | optional int8 | time integration scheme used
            where it is left open Fox-Goodwin's, with more mass of fast modes, average acceleration, or HHT-alpha with
            -0.05
        diverged_step | | | optional int64 | first step at which the variant had diverged
            counted from the start; -1 where it did not diverge
        work | | | optional | work of the variant
            modes x steps of its own march over one passage or cycle; 0 for statics
        error_estimate | | | optional nan | estimated relative error
            the largest of estimated_error over the results that are held to a tolerance; NaN where none is, or where no
            estimate exists
        estimated_error | result | | optional float32 nan | estimated error of every reported number
            over the largest static value of the sensor (velocity and acceleration, and where it reads nothing at rest:
            over its own largest value; contact forces: over the weight, of forces that pulsate over their own largest;
            positions and lags: over the length of the track and of the cruise; times of extremes: over one passage or
            cycle; indices: as they are; frequencies, settling times and times of move and settling: over themselves;
            other results at rest: over the largest along the way); of places and times of extremes no less than a step;
            NaN where no estimate exists
        tolerance | result | | optional alone nan | tolerance of every reported number
            that of its sensor, else solver.tolerance; NaN where the error is reported, but not held
        """,
        flags={"status": Status, "fidelity_used": Fidelity, "scheme_used": SchemeUsed},
    ),
)

MARCH = outputs("""
    {sensor}_max | | {sensor} | | largest value of {sensor}
        over all step instants (asymmetry, double-peak: of the last cycle)
    {sensor}_max_position | | m | nan | position of the first carriage at the largest value of {sensor}
        of the first one also where the sensor is under another; NaN where it was off its body, as the first axle of a
        train often is by then
    {sensor}_max_time | | s | optional nan | time of the largest value of {sensor}
        since time 0, at its step; NaN where it has none
    {sensor}_min | | {sensor} | | smallest value of {sensor}
        over all step instants (asymmetry, double-peak: of the last cycle)
    {sensor}_min_position | | m | nan | position of the first carriage at the smallest value of {sensor}
        of the first one also where the sensor is under another; NaN where it was off its body, as the first axle of a
        train often is by then
    {sensor}_min_time | | s | optional nan | time of the smallest value of {sensor}
        since time 0, at its step; NaN where it has none
    {sensor}_rms | | {sensor} | optional | root mean square of {sensor}
        averaged over the recorded time; of sensors under a carriage, over the time that it is on the body
    {sensor}_residual | | {sensor} | optional nan | residual vibration of {sensor}
        largest difference from its static value there after all carriages have come to rest or left; NaN where it is
        under one that has left
    {sensor}_settling_time | | s | optional nan | settling time of {sensor}
        after all carriages have come to rest or left, until it stays within its settling_band of its static value; NaN
        where it has not settled a longest period, or two beats, before the end of the run
    {sensor}_move_and_settle_time | | s | optional nan | time of move and settling of {sensor}
        from time 0 until then: when all carriages have come to rest or left, and its settling time; NaN as that
    {carriage}_contact_force_max | | N | nan | largest contact force of {carriage}
        over its way, without the last 2 % of the track towards a held end; NaN where the carriage is never there
    {carriage}_contact_force_min | | N | nan | smallest contact force of {carriage}
        over its way, without the last 2 % of the track towards a held end; NaN where the carriage is never there
    {carriage}_contact_force_min_position | | m | nan | position of {carriage} at its smallest contact force
        of its reference; NaN where that is off the body, or it never touches it
    {carriage}_separation_position | | m | optional nan | first position of {carriage} with a negative contact force
        NaN where the contact holds
    {sensor} | position/phase/station | {sensor} | optional history gaps | history of {sensor}
        at the instants of `elapsed`; NaN where a sensor under a carriage is off the body
    {carriage}_position | position/phase/station | m | optional history nan | position of {carriage}
        NaN where it is off the body
    {envelope}_envelope_max | {envelope}_place | {envelope} | | largest value at each place of {envelope}
        over the instants over which extremes of sensors are taken
    {envelope}_envelope_min | {envelope}_place | {envelope} | | smallest value at each place of {envelope}
        over the instants over which extremes of sensors are taken
    {envelope}_place | | m | axis | place of {envelope}
        coordinate of the envelope, along its body
""")
declare("march", *MARCH)

declare(
    "cells",
    *outputs("""
        status_count | status_name | | int64 | number of variants by status
            of the cell, whose own status, model, modes and steps are the most serious and the largest of its variants
        smallest | result | - | nan | smallest value of every reported number
            over the variants of the cell that have one, in its unit; NaN where none has
        smallest_error | result | | nan | estimated error of the smallest value
            as `estimated_error` of its variant, over the same scale; NaN where no estimate exists
        smallest_variant | result | | int64 | variant with the smallest value
            its flat number in the sweep's grid, last axis fastest; -1 where there is none
        smallest_at | result swept | - | nan | swept numbers of the variant with the smallest value
            in their units
        largest | result | - | nan | largest value of every reported number
            over the variants of the cell that have one, in its unit; NaN where none has
        largest_error | result | | nan | estimated error of the largest value
            as `estimated_error` of its variant, over the same scale; NaN where no estimate exists
        largest_variant | result | | int64 | variant with the largest value
            its flat number in the sweep's grid, last axis fastest; -1 where there is none
        largest_at | result swept | - | nan | swept numbers of the variant with the largest value
            in their units
        percentile | result percent | - | optional nan | percentiles of every reported number
            over the variants of the cell that have one, in its unit, exact, linear between neighbours
    """),
)

declare(
    "/model",
    *outputs("""
        frequency | body_mode/mode | Hz | alone | natural frequency of the body
            over `mode` in older archives
        damping_ratio | body_mode/mode | | optional alone | damping ratio of the mode
        mode_shape | body_mode/mode track_position/position | kg-0.5 | optional alone | mode shape on the track
            unit modal mass
        length | | m | alone | length of the track
        mass | | kg | alone | mass of the body
        first_frequency | | Hz | optional some | lowest elastic natural frequency of the body
            of a body out of files, over the axes of the sweep that change it
    """),
)

declare(
    "/unreduced",
    *outputs("""
        * | | | alone |
        marched | sample sensor station | - | nan | history by the march of modes
            in the unit of its sensor
        marched_static | sample sensor station | - | nan | static response by the modes at the same places
        unreduced | sample sensor station | - | nan | history by the unreduced finite-element model
        unreduced_static | sample sensor station | - | nan | static response by the unreduced model at the same places
        elapsed | sample station | s | nan | time since the start
        position | sample station | m | nan | position of the first carriage
            NaN where it is off its body
        difference | sample sensor | | nan | largest difference of both models
            of their histories, over the range of the unreduced model's; NaN where that does not vary
        dynamic_difference | sample sensor | | nan | largest difference of the dynamic parts
            history less static response at the same places, each model with its own; over the range of the unreduced
            model's dynamic part
        static_difference | sample sensor | | nan | largest difference of the static responses
            of both models at the same places, over the range of the unreduced model's
        dynamic_range | sample sensor | | nan | range of the unreduced model's dynamic part
            of that part, over the range of its history
        sensor_quantity | sensor | | str | quantity of the sensor
        degrees_of_freedom | sample | | int64 | degrees of freedom of the unreduced model
        unreduced_steps | sample | | int64 | steps of the unreduced model over the whole way
    """),
)

declare(
    "/audit",
    *outputs(
        """
        * | | | alone |
        observed_error | sample result | | nan | observed error of every reported number
            difference from the same variant marched with all terms, more modes and more steps until nothing that is
            held changes, and one level beyond; over what estimated_error is divided by; NaN where it could not be
            compared
        estimated_error | sample result | | nan | estimated error of every reported number
            that of the archive
        tolerance | result | | nan | tolerance of every reported number
            NaN where none is held
        tolerance_asked | sample | | nan | solver.tolerance of the variant over that of the study
        variant_status | sample | | int8 | status of the variant
            that of the study: no tolerance is promised but to those that are ok
        left_out | | | int64 | variants that were picked for the audit and could not be compared
            not among the samples: no values, no reference, or none but the very march of the archive
        """,
        {"variant_status": Status},
    ),
)
