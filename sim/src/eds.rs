//! The electronic data sheet (EDS) of a node, written from its own object dictionary.

use std::fmt::{self, Write};

use ilc_rt::fieldbus::cia402::objects;

use crate::node::Dictionary;
use crate::node::dictionary::{Access, Allowed, Entry, Mappable};
use crate::node::value::Value;

/// Returns the data sheet (CiA 306) of a node as text; its defaults are the node's power-on values.
pub fn write(dictionary: &Dictionary, product: &str) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = sections(&mut text, dictionary, product);
    text
}

fn sections(text: &mut String, dictionary: &Dictionary, product: &str) -> fmt::Result {
    writeln!(
        text,
        "[FileInfo]\nFileName=ilc-sim.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0"
    )?;
    writeln!(text, "Description=Simulated node of ilc-sim\n")?;
    writeln!(text, "[DeviceInfo]\nVendorName=ilc-sim\nVendorNumber=0\nProductName={product}")?;
    for rate in [10, 20, 50, 125, 250, 500, 800, 1000] {
        writeln!(text, "BaudRate_{rate}=1")?;
    }
    writeln!(text, "SimpleBootUpSlave=1\nSimpleBootUpMaster=0\nGranularity=8")?;
    writeln!(text, "DynamicChannelsSupported=0\nGroupMessaging=0")?;
    writeln!(text, "NrOfRXPDO=4\nNrOfTXPDO=4\nLSS_Supported=0\n")?;

    let shown = dictionary.entries().iter().filter(|entry| !entry.is_hidden());
    let shown: Vec<Entry> = shown.copied().collect();
    let groups: Vec<&[Entry]> = shown.chunk_by(|a, b| a.address.index == b.address.index).collect();
    let is_mandatory =
        |index| matches!(index, objects::DEVICE_TYPE | objects::ERROR_REGISTER | objects::IDENTITY);
    let is_manufacturers = |index| (0x2000..0x6000).contains(&index);
    list(text, "MandatoryObjects", &groups, is_mandatory)?;
    list(text, "OptionalObjects", &groups, |index| {
        !is_mandatory(index) && !is_manufacturers(index)
    })?;
    list(text, "ManufacturerObjects", &groups, is_manufacturers)?;
    groups.into_iter().try_for_each(|group| object(text, group))
}

fn list(
    text: &mut String,
    title: &str,
    groups: &[&[Entry]],
    belongs: impl Fn(u16) -> bool,
) -> fmt::Result {
    let indices = || groups.iter().map(|group| group[0].address.index).filter(|i| belongs(*i));
    writeln!(text, "[{title}]\nSupportedObjects={}", indices().count())?;
    for (number, index) in (1..).zip(indices()) {
        writeln!(text, "{number}=0x{index:04X}")?;
    }
    writeln!(text)
}

fn object(text: &mut String, group: &[Entry]) -> fmt::Result {
    let index = group[0].address.index;
    if let [only] = group {
        writeln!(text, "[{index:04X}]")?;
        return variable(text, only);
    }
    let name = objects::name(index).or_else(|| objects::name(index & 0xFFFC)).unwrap_or("Record");
    writeln!(text, "[{index:04X}]\nParameterName={name}\nObjectType=0x9")?;
    writeln!(text, "SubNumber={}\n", group.len())?;
    for entry in group {
        writeln!(text, "[{index:04X}sub{:X}]", entry.address.sub)?;
        variable(text, entry)?;
    }
    Ok(())
}

fn variable(text: &mut String, entry: &Entry) -> fmt::Result {
    let data_type = match entry.power_on {
        Value::I8(_) => 2,
        Value::I16(_) => 3,
        Value::I32(_) => 4,
        Value::U8(_) => 5,
        Value::U16(_) => 6,
        Value::U32(_) => 7,
        Value::Text(_) => 9,
    };
    let access = match entry.access {
        Access::Constant => "const",
        Access::ReadOnly => "ro",
        Access::ReadWrite => "rw",
        Access::WriteOnly => "wo",
    };
    writeln!(text, "ParameterName={}\nObjectType=0x7\nDataType=0x{data_type:04X}", entry.name)?;
    writeln!(text, "AccessType={access}")?;
    match entry.power_on {
        Value::Text(value) => {
            writeln!(text, "DefaultValue={}", String::from_utf8_lossy(value.as_bytes()))?;
        }
        value => writeln!(text, "DefaultValue={}", value.number())?,
    }
    if let Allowed::Range(low, high) = entry.allowed {
        writeln!(text, "LowLimit={low}\nHighLimit={high}")?;
    }
    writeln!(text, "PDOMapping={}\n", u8::from(entry.mappable != Mappable::No))
}
