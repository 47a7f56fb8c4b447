//! The slots of the objects that a simulated drive uses, looked up once.

use ilc_rt::fieldbus::canopen::{AbortCode, ObjectAddress};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Dictionary, Slot};
use super::profile_objects::{SIMULATED_FAULT, SIMULATED_INPUTS};

macro_rules! slots {
    ($($name:ident = $index:expr, $sub:literal;)*) => {
        /// The slots of the objects that the drive uses, looked up once.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct DriveSlots {
            $(pub(super) $name: Slot,)*
        }

        impl DriveSlots {
            pub(super) fn find(dictionary: &Dictionary) -> Result<Self, AbortCode> {
                Ok(Self { $($name: dictionary.find(ObjectAddress::new($index, $sub))?,)* })
            }
        }
    };
}

slots! {
    connection_loss_option = objects::CONNECTION_LOSS_OPTION, 0;
    error_code = objects::ERROR_CODE, 0;
    controlword = objects::CONTROLWORD, 0;
    statusword = objects::STATUSWORD, 0;
    quick_stop_option = objects::QUICK_STOP_OPTION, 0;
    shutdown_option = objects::SHUTDOWN_OPTION, 0;
    disable_option = objects::DISABLE_OPTION, 0;
    halt_option = objects::HALT_OPTION, 0;
    fault_reaction_option = objects::FAULT_REACTION_OPTION, 0;
    mode = objects::MODE_OF_OPERATION, 0;
    mode_display = objects::MODE_DISPLAY, 0;
    position_demand = objects::POSITION_DEMAND, 0;
    position_internal = objects::POSITION_INTERNAL, 0;
    position_actual = objects::POSITION_ACTUAL, 0;
    error_window = objects::FOLLOWING_ERROR_WINDOW, 0;
    error_time_ms = objects::FOLLOWING_ERROR_TIME, 0;
    velocity_demand = objects::VELOCITY_DEMAND, 0;
    velocity_actual = objects::VELOCITY_ACTUAL, 0;
    target_torque = objects::TARGET_TORQUE, 0;
    torque_demand = objects::TORQUE_DEMAND, 0;
    torque_actual = objects::TORQUE_ACTUAL, 0;
    target_position = objects::TARGET_POSITION, 0;
    position_min = objects::POSITION_LIMIT, 1;
    position_max = objects::POSITION_LIMIT, 2;
    velocity_max = objects::MAX_VELOCITY, 0;
    range_min = objects::POSITION_RANGE_LIMIT, 1;
    range_max = objects::POSITION_RANGE_LIMIT, 2;
    home_offset = objects::HOME_OFFSET, 0;
    polarity = objects::POLARITY, 0;
    motor_speed_max = objects::MAX_MOTOR_SPEED, 0;
    profile_deceleration = objects::PROFILE_DECELERATION, 0;
    deceleration = objects::QUICK_STOP_DECELERATION, 0;
    acceleration_max = objects::MAX_ACCELERATION, 0;
    deceleration_max = objects::MAX_DECELERATION, 0;
    torque_max = objects::MAX_TORQUE, 0;
    current_max = objects::MAX_CURRENT, 0;
    positive_torque = objects::POSITIVE_TORQUE_LIMIT, 0;
    negative_torque = objects::NEGATIVE_TORQUE_LIMIT, 0;
    encoder_increments = objects::ENCODER_RESOLUTION, 1;
    encoder_revolutions = objects::ENCODER_RESOLUTION, 2;
    velocity_increments = objects::VELOCITY_RESOLUTION, 1;
    velocity_revolutions = objects::VELOCITY_RESOLUTION, 2;
    gear_motor = objects::GEAR_RATIO, 1;
    gear_shaft = objects::GEAR_RATIO, 2;
    feed = objects::FEED_CONSTANT, 1;
    feed_revolutions = objects::FEED_CONSTANT, 2;
    velocity_numerator = objects::VELOCITY_FACTOR, 1;
    velocity_denominator = objects::VELOCITY_FACTOR, 2;
    acceleration_numerator = objects::ACCELERATION_FACTOR, 1;
    acceleration_denominator = objects::ACCELERATION_FACTOR, 2;
    position_unit = objects::POSITION_UNIT, 0;
    velocity_unit = objects::VELOCITY_UNIT, 0;
    position_offset = objects::POSITION_OFFSET, 0;
    velocity_offset = objects::VELOCITY_OFFSET, 0;
    torque_offset = objects::TORQUE_OFFSET, 0;
    period = objects::INTERPOLATION_PERIOD, 1;
    period_exponent = objects::INTERPOLATION_PERIOD, 2;
    following_error = objects::FOLLOWING_ERROR_ACTUAL, 0;
    target_velocity = objects::TARGET_VELOCITY, 0;
    position_window = objects::POSITION_WINDOW, 0;
    position_window_ms = objects::POSITION_WINDOW_TIME, 0;
    velocity_window = objects::VELOCITY_WINDOW, 0;
    velocity_window_ms = objects::VELOCITY_WINDOW_TIME, 0;
    velocity_threshold = objects::VELOCITY_THRESHOLD, 0;
    velocity_threshold_ms = objects::VELOCITY_THRESHOLD_TIME, 0;
    profile_velocity = objects::PROFILE_VELOCITY, 0;
    profile_acceleration = objects::PROFILE_ACCELERATION, 0;
    homing_method = objects::HOMING_METHOD, 0;
    homing_speed = objects::HOMING_SPEEDS, 1;
    homing_creep = objects::HOMING_SPEEDS, 2;
    homing_acceleration = objects::HOMING_ACCELERATION, 0;
    digital_inputs = objects::DIGITAL_INPUTS, 0;
    digital_outputs = objects::DIGITAL_OUTPUTS, 1;
    output_mask = objects::DIGITAL_OUTPUTS, 2;
    simulated_inputs = SIMULATED_INPUTS, 0;
    simulated_fault = SIMULATED_FAULT, 0;
}
