//! Why an SDO transfer was aborted.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

macro_rules! abort_codes {
    ($($name:ident = $code:literal, $meaning:literal;)*) => {
        /// The abort codes of CiA 301, by name.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum AbortCode {
            $(#[doc = $meaning] $name,)*
            /// A code that CiA 301 does not list.
            Other(u32),
        }

        impl AbortCode {
            /// All named codes.
            pub const NAMED: &'static [Self] = &[$(Self::$name),*];

            /// The code on the wire.
            pub const fn code(self) -> u32 {
                match self {
                    $(Self::$name => $code,)*
                    Self::Other(code) => code,
                }
            }

            /// The name of a code on the wire.
            pub const fn from_code(code: u32) -> Self {
                match code {
                    $($code => Self::$name,)*
                    _ => Self::Other(code),
                }
            }

            /// What it means, in words.
            pub const fn meaning(self) -> &'static str {
                match self {
                    $(Self::$name => $meaning,)*
                    Self::Other(_) => "a code that CANopen does not list",
                }
            }
        }
    };
}

abort_codes! {
    ToggleBit = 0x0503_0000, "toggle bit not alternated";
    Timeout = 0x0504_0000, "SDO protocol timed out";
    UnknownCommand = 0x0504_0001, "command specifier unknown or not supported";
    OutOfMemory = 0x0504_0005, "out of memory";
    UnsupportedAccess = 0x0601_0000, "access not supported";
    WriteOnly = 0x0601_0001, "object is write-only";
    ReadOnly = 0x0601_0002, "object is read-only";
    NoObject = 0x0602_0000, "object does not exist";
    NotMappable = 0x0604_0041, "object cannot be mapped to this PDO";
    PdoTooLong = 0x0604_0042, "mapped objects exceed the length of the PDO";
    Incompatible = 0x0604_0043, "parameters are incompatible";
    Hardware = 0x0606_0000, "access failed due to a hardware error";
    Length = 0x0607_0010, "length does not match";
    TooLong = 0x0607_0012, "value too long";
    TooShort = 0x0607_0013, "value too short";
    NoSubIndex = 0x0609_0011, "sub-index does not exist";
    ValueRange = 0x0609_0030, "value out of range";
    ValueTooHigh = 0x0609_0031, "value too high";
    ValueTooLow = 0x0609_0032, "value too low";
    General = 0x0800_0000, "general error";
    CannotStore = 0x0800_0020, "value cannot be transferred or stored";
    LocalControl = 0x0800_0021, "refused because of local control";
    DeviceState = 0x0800_0022, "refused in the present state of the device";
}

impl std::fmt::Display for AbortCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "0x{:08X} ({})", self.code(), self.meaning())
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::*;

    #[test]
    fn every_code_keeps_its_name() {
        for &abort in AbortCode::NAMED {
            assert_eq!(AbortCode::from_code(abort.code()), abort);
        }
        assert_eq!(AbortCode::from_code(0x0602_0000), AbortCode::NoObject);
        assert_eq!(AbortCode::from_code(0x1234), AbortCode::Other(0x1234));
    }
}
