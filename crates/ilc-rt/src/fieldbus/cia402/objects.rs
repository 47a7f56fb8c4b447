//! The objects of the dictionary: index and name, once.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

macro_rules! objects {
    ($($constant:ident = $index:literal, $name:literal;)*) => {
        $(#[doc = $name] pub const $constant: u16 = $index;)*

        /// Returns the name of the object at `index`, if it is listed here.
        pub const fn name(index: u16) -> Option<&'static str> {
            match index {
                $($index => Some($name),)*
                _ => None,
            }
        }
    };
}

objects! {
    DEVICE_TYPE = 0x1000, "Device type";
    ERROR_REGISTER = 0x1001, "Error register";
    ERROR_HISTORY = 0x1003, "Pre-defined error field";
    COB_ID_SYNC = 0x1005, "COB-ID SYNC";
    CYCLE_PERIOD = 0x1006, "Communication cycle period";
    SYNC_WINDOW = 0x1007, "Synchronous window length";
    DEVICE_NAME = 0x1008, "Manufacturer device name";
    HARDWARE_VERSION = 0x1009, "Manufacturer hardware version";
    SOFTWARE_VERSION = 0x100A, "Manufacturer software version";
    GUARD_TIME = 0x100C, "Guard time";
    LIFE_TIME_FACTOR = 0x100D, "Life time factor";
    STORE_PARAMETERS = 0x1010, "Store parameters";
    RESTORE_DEFAULTS = 0x1011, "Restore default parameters";
    COB_ID_EMCY = 0x1014, "COB-ID EMCY";
    INHIBIT_TIME_EMCY = 0x1015, "Inhibit time EMCY";
    CONSUMER_HEARTBEAT = 0x1016, "Consumer heartbeat time";
    PRODUCER_HEARTBEAT = 0x1017, "Producer heartbeat time";
    IDENTITY = 0x1018, "Identity object";
    SYNC_COUNTER_OVERFLOW = 0x1019, "Synchronous counter overflow value";
    ERROR_BEHAVIOUR = 0x1029, "Error behaviour";
    SDO_SERVER = 0x1200, "SDO server parameter";
    RPDO_COMMUNICATION = 0x1400, "RPDO communication parameter";
    RPDO_MAPPING = 0x1600, "RPDO mapping parameter";
    TPDO_COMMUNICATION = 0x1800, "TPDO communication parameter";
    TPDO_MAPPING = 0x1A00, "TPDO mapping parameter";
    CONNECTION_LOSS_OPTION = 0x6007, "Abort connection option code";
    ENCODER_POSITIONS = 0x6020, "Position values for multi-sensor devices";
    ERROR_CODE = 0x603F, "Error code";
    CONTROLWORD = 0x6040, "Controlword";
    STATUSWORD = 0x6041, "Statusword";
    QUICK_STOP_OPTION = 0x605A, "Quick stop option code";
    SHUTDOWN_OPTION = 0x605B, "Shutdown option code";
    DISABLE_OPTION = 0x605C, "Disable operation option code";
    HALT_OPTION = 0x605D, "Halt option code";
    FAULT_REACTION_OPTION = 0x605E, "Fault reaction option code";
    MODE_OF_OPERATION = 0x6060, "Modes of operation";
    MODE_DISPLAY = 0x6061, "Modes of operation display";
    POSITION_DEMAND = 0x6062, "Position demand value";
    POSITION_INTERNAL = 0x6063, "Position actual internal value";
    POSITION_ACTUAL = 0x6064, "Position actual value";
    FOLLOWING_ERROR_WINDOW = 0x6065, "Following error window";
    FOLLOWING_ERROR_TIME = 0x6066, "Following error time out";
    VELOCITY_DEMAND = 0x606B, "Velocity demand value";
    VELOCITY_ACTUAL = 0x606C, "Velocity actual value";
    TARGET_TORQUE = 0x6071, "Target torque";
    MAX_TORQUE = 0x6072, "Max torque";
    MAX_CURRENT = 0x6073, "Max current";
    RATED_TORQUE = 0x6076, "Motor rated torque";
    TORQUE_ACTUAL = 0x6077, "Torque actual value";
    TARGET_POSITION = 0x607A, "Target position";
    POSITION_RANGE_LIMIT = 0x607B, "Position range limit";
    HOME_OFFSET = 0x607C, "Home offset";
    POSITION_LIMIT = 0x607D, "Software position limit";
    POLARITY = 0x607E, "Polarity";
    MAX_VELOCITY = 0x607F, "Max profile velocity";
    MAX_MOTOR_SPEED = 0x6080, "Max motor speed";
    PROFILE_ACCELERATION = 0x6083, "Profile acceleration";
    PROFILE_DECELERATION = 0x6084, "Profile deceleration";
    QUICK_STOP_DECELERATION = 0x6085, "Quick stop deceleration";
    ENCODER_RESOLUTION = 0x608F, "Position encoder resolution";
    VELOCITY_RESOLUTION = 0x6090, "Velocity encoder resolution";
    GEAR_RATIO = 0x6091, "Gear ratio";
    FEED_CONSTANT = 0x6092, "Feed constant";
    VELOCITY_FACTOR = 0x6096, "Velocity factor";
    ACCELERATION_FACTOR = 0x6097, "Acceleration factor";
    HOMING_METHOD = 0x6098, "Homing method";
    HOMING_SPEEDS = 0x6099, "Homing speeds";
    HOMING_ACCELERATION = 0x609A, "Homing acceleration";
    POSITION_UNIT = 0x60A8, "SI unit position";
    VELOCITY_UNIT = 0x60A9, "SI unit velocity";
    POSITION_OFFSET = 0x60B0, "Position offset";
    VELOCITY_OFFSET = 0x60B1, "Velocity offset";
    TORQUE_OFFSET = 0x60B2, "Torque offset";
    INTERPOLATION_PERIOD = 0x60C2, "Interpolation time period";
    MAX_ACCELERATION = 0x60C5, "Max acceleration";
    MAX_DECELERATION = 0x60C6, "Max deceleration";
    POSITIVE_TORQUE_LIMIT = 0x60E0, "Positive torque limit value";
    NEGATIVE_TORQUE_LIMIT = 0x60E1, "Negative torque limit value";
    FOLLOWING_ERROR_ACTUAL = 0x60F4, "Following error actual value";
    DIGITAL_INPUTS = 0x60FD, "Digital inputs";
    DIGITAL_OUTPUTS = 0x60FE, "Digital outputs";
    TARGET_VELOCITY = 0x60FF, "Target velocity";
    SUPPORTED_MODES = 0x6502, "Supported drive modes";
}

/// Device profile number of a drive, in the low word of [`DEVICE_TYPE`].
pub const PROFILE_DRIVE: u16 = 402;
/// Device profile number of an encoder, in the low word of [`DEVICE_TYPE`].
pub const PROFILE_ENCODER: u16 = 406;
