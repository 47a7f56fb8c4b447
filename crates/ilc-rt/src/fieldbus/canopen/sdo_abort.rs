//! Abort codes of SDO transfers.

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

            /// Returns the code on the wire.
            pub const fn code(self) -> u32 {
                match self {
                    $(Self::$name => $code,)*
                    Self::Other(code) => code,
                }
            }

            /// Returns the name of a code on the wire.
            pub const fn from_code(code: u32) -> Self {
                match code {
                    $($code => Self::$name,)*
                    _ => Self::Other(code),
                }
            }

            /// Returns its meaning in words.
            pub const fn meaning(self) -> &'static str {
                match self {
                    $(Self::$name => $meaning,)*
                    Self::Other(_) => "vendor-specific or not listed in CiA 301",
                }
            }
        }
    };
}

abort_codes! {
    ToggleBit = 0x0503_0000, "toggle bit not alternated";
    Timeout = 0x0504_0000, "SDO protocol timed out";
    UnknownCommand = 0x0504_0001, "command specifier unknown or not supported";
    BlockSize = 0x0504_0002, "invalid block size";
    SequenceNumber = 0x0504_0003, "invalid sequence number";
    Crc = 0x0504_0004, "CRC error";
    OutOfMemory = 0x0504_0005, "out of memory";
    UnsupportedAccess = 0x0601_0000, "access not supported";
    WriteOnly = 0x0601_0001, "object is write-only";
    ReadOnly = 0x0601_0002, "object is read-only";
    NoObject = 0x0602_0000, "object does not exist";
    NotMappable = 0x0604_0041, "object cannot be mapped to this PDO";
    PdoTooLong = 0x0604_0042, "mapped objects exceed the length of the PDO";
    Incompatible = 0x0604_0043, "parameters are incompatible";
    InternalIncompatibility = 0x0604_0047, "general internal incompatibility in the device";
    Hardware = 0x0606_0000, "access failed due to a hardware error";
    Length = 0x0607_0010, "length does not match";
    TooLong = 0x0607_0012, "value too long";
    TooShort = 0x0607_0013, "value too short";
    NoSubIndex = 0x0609_0011, "sub-index does not exist";
    ValueRange = 0x0609_0030, "value out of range";
    ValueTooHigh = 0x0609_0031, "value too high";
    ValueTooLow = 0x0609_0032, "value too low";
    MaximumBelowMinimum = 0x0609_0036, "maximum value is less than minimum value";
    NoSdoConnection = 0x060A_0023, "resource not available: SDO connection";
    General = 0x0800_0000, "general error";
    CannotStore = 0x0800_0020, "value cannot be transferred or stored";
    LocalControl = 0x0800_0021, "refused because of local control";
    DeviceState = 0x0800_0022, "refused in the present state of the device";
    NoDictionary = 0x0800_0023, "no object dictionary, or it cannot be generated";
    NoData = 0x0800_0024, "no data available";
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

    #[test]
    fn every_code_is_told_with_number_and_meaning() {
        // CiA 301, table 22, complete.
        for (code, text) in [
            (0x0503_0000, "0x05030000 (toggle bit not alternated)"),
            (0x0504_0002, "0x05040002 (invalid block size)"),
            (0x0504_0003, "0x05040003 (invalid sequence number)"),
            (0x0504_0004, "0x05040004 (CRC error)"),
            (0x0604_0047, "0x06040047 (general internal incompatibility in the device)"),
            (0x0609_0036, "0x06090036 (maximum value is less than minimum value)"),
            (0x060A_0023, "0x060A0023 (resource not available: SDO connection)"),
            (0x0800_0023, "0x08000023 (no object dictionary, or it cannot be generated)"),
            (0x0800_0024, "0x08000024 (no data available)"),
            (0x0F00_FFC0, "0x0F00FFC0 (vendor-specific or not listed in CiA 301)"),
        ] {
            assert_eq!(AbortCode::from_code(code).to_string(), text);
        }
        let mut codes: Vec<u32> = AbortCode::NAMED.iter().map(|abort| abort.code()).collect();
        codes.dedup();
        assert_eq!(codes.len(), 31);
        assert!(codes.is_sorted());
    }
}
