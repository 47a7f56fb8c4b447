//! Reading of a data sheet: its sections become typed objects.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use configparser::ini::Ini;

use super::error::DataSheetError;
use super::number::{Number, number, plain};
use crate::config::read_file;
use crate::fieldbus::bring_up::Kind;
use crate::fieldbus::canopen::ObjectAddress;

/// Largest data sheet: ten times that of a drive with every object of the profile.
const SHEET_BYTES_MAX: u64 = 8 << 20;
/// Largest number of objects of a data sheet.
const OBJECTS_MAX: usize = 100_000;
/// Lowest index that is not a definition of a data type.
const FIRST_OBJECT: u16 = 0x1000;

/// Access of a master to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read only, or constant.
    Read,
    /// Write only.
    Write,
    /// Both.
    ReadWrite,
}

/// An object of a data sheet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SheetObject {
    /// Type, if it is a number of up to 32 bits.
    pub kind: Option<Kind>,
    /// Access.
    pub access: Access,
    /// May be part of process data.
    pub is_mappable: bool,
    /// Value after power-on.
    default: Option<Number>,
    /// Value that the configuration (DCF) gives it.
    configured: Option<Number>,
}

/// A data sheet: the objects of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DataSheet {
    /// Name of the file, for messages.
    pub file: String,
    /// Node number, as given or as the configuration states it.
    pub node: Option<u8>,
    objects: BTreeMap<(u16, u8), SheetObject>,
    /// Numbers of the section about the device.
    device: HashMap<String, i64>,
}

impl DataSheet {
    /// Reads a data sheet; `node` replaces the node number that the file states.
    ///
    /// # Errors
    /// [`DataSheetError`] for a file that cannot be read, or that is no data sheet.
    pub fn load(path: &Path, node: Option<u8>) -> Result<Self, DataSheetError> {
        let file = path.display().to_string();
        let bytes = read_file(path, SHEET_BYTES_MAX)
            .map_err(|reason| DataSheetError::Read { file: file.clone(), reason })?;
        Self::parse(&bytes, &file, node)
    }

    /// Reads a data sheet from its bytes, UTF-8 or Latin-1; `file` names it in messages.
    ///
    /// # Errors
    /// [`DataSheetError::NoSheet`] for a text without any object.
    pub fn parse(bytes: &[u8], file: &str, node: Option<u8>) -> Result<Self, DataSheetError> {
        let refused = |reason: String| DataSheetError::NoSheet { file: file.to_owned(), reason };
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{FEFF}').to_owned(),
            // Every byte is a character of Latin-1.
            Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
        };
        let map = ini().read(sound_lines(&text)).map_err(refused)?;
        let mut sheet = Self {
            file: file.to_owned(),
            node: node.filter(|node| (1..=127).contains(node)),
            objects: BTreeMap::new(),
            device: HashMap::new(),
        };
        for (name, section) in &map {
            match name.as_str() {
                "deviceinfo" => sheet.device = numbers(section),
                // The standard spells it with one m.
                "devicecomissioning" | "devicecommissioning" => {
                    let stated = numbers(section).get("nodeid").copied();
                    let stated = stated.and_then(|stated| u8::try_from(stated).ok());
                    let stated = stated.filter(|stated| (1..=127).contains(stated));
                    sheet.node = sheet.node.or(stated);
                }
                _ => sheet.take(name, section, &map),
            }
            if sheet.objects.len() > OBJECTS_MAX {
                return Err(refused(format!("more than {OBJECTS_MAX} objects")));
            }
        }
        if sheet.objects.is_empty() {
            return Err(refused("it describes no object".to_owned()));
        }
        Ok(sheet)
    }

    /// Takes the objects of a section, if it describes any.
    fn take(&mut self, name: &str, section: &Keys, all: &Sections) {
        let (index, sub) = match name.split_once("sub") {
            Some((index, sub)) => (index, u8::from_str_radix(sub.trim(), 16).ok()),
            None => (name, Some(0)),
        };
        let index = index.trim();
        let is_index = index.len() == 4 && index.bytes().all(|b| b.is_ascii_hexdigit());
        let (Some(sub), true) = (sub, is_index) else { return };
        let Ok(index) = u16::from_str_radix(index, 16) else { return };
        if index < FIRST_OBJECT {
            return;
        }
        if let Some(n_subs) = text_of(section, "compactsubobj").and_then(plain).filter(|n| *n > 0) {
            self.take_compact(index, n_subs, section, all);
        } else if section.contains_key("datatype") {
            self.objects.insert((index, sub), object(section));
        }
    }

    /// Takes an array whose elements are described once; their values may have a section.
    fn take_compact(&mut self, index: u16, n_subs: i64, section: &Keys, all: &Sections) {
        let last = u8::try_from(n_subs.min(254)).unwrap_or(254);
        let count = SheetObject {
            kind: Some(Kind::U8),
            access: Access::Read,
            is_mappable: false,
            default: Some(Number::Plain(last.into())),
            configured: None,
        };
        self.objects.entry((index, 0)).or_insert(count);
        let values = all.get(&format!("{index:04x}value"));
        for sub in 1..=last {
            let mut element = object(section);
            let value = values.and_then(|values| text_of(values, &sub.to_string()));
            element.configured = value.and_then(number).or(element.configured);
            self.objects.entry((index, sub)).or_insert(element);
        }
    }

    /// Returns an object.
    pub fn get(&self, index: u16, sub: u8) -> Option<&SheetObject> {
        self.objects.get(&(index, sub))
    }

    /// Returns all objects in order.
    pub fn objects(&self) -> impl Iterator<Item = (ObjectAddress, &SheetObject)> {
        self.objects.iter().map(|((index, sub), object)| (ObjectAddress::new(*index, *sub), object))
    }

    /// Returns the value that an object will have: configured, or after power-on.
    pub fn value(&self, index: u16, sub: u8) -> Option<i64> {
        let object = self.get(index, sub)?;
        self.number(object, object.configured.or(object.default)?)
    }

    /// Returns the value that the configuration gives an object, if it differs from the one after
    /// power-on.
    ///
    /// # Errors
    /// [`DataSheetError::NeedsNode`] if it depends on the unknown node number.
    pub fn configured(
        &self,
        address: ObjectAddress,
        object: &SheetObject,
    ) -> Result<Option<i64>, DataSheetError> {
        if object.configured.is_none() || object.configured == object.default {
            return Ok(None);
        }
        let Some(configured) = object.configured else { return Ok(None) };
        if configured.of(self.node).is_none() {
            let Number::OfNode(offset) = configured else { return Ok(None) };
            let value = format!("$NODEID+0x{offset:X}");
            return Err(DataSheetError::NeedsNode {
                file: self.file.clone(),
                object: address,
                value,
            });
        }
        let default = object.default.and_then(|default| self.number(object, default));
        Ok(self.number(object, configured).filter(|value| Some(*value) != default))
    }

    /// Returns a number about the device, by its key in lower case.
    pub fn device(&self, key: &str) -> Option<i64> {
        self.device.get(key).copied()
    }

    /// Returns a number in the type of an object: signed ones are often given by their bits.
    fn number(&self, object: &SheetObject, number: Number) -> Option<i64> {
        let value = number.of(self.node)?;
        let Some(kind) = object.kind else { return Some(value) };
        let (low, high) = kind.range();
        let span = high - low + 1;
        let value = if low < 0 && value > high && value < span { value - span } else { value };
        (low..=high).contains(&value).then_some(value)
    }
}

type Keys = HashMap<String, Option<String>>;
type Sections = HashMap<String, Keys>;

fn ini() -> Ini {
    let mut ini = Ini::new();
    let mut rules = ini.defaults();
    rules.comment_symbols = vec![';', '#'];
    rules.inline_comment_symbols = Some(vec![';']);
    rules.delimiters = vec!['='];
    ini.load_defaults(rules);
    ini
}

/// Returns the lines that are a section or a key: others are noise.
fn sound_lines(text: &str) -> String {
    let is_sound = |line: &&str| {
        let line = line.trim_start();
        let before_comment = line.split(';').next().unwrap_or("");
        if line.starts_with('[') {
            before_comment.contains(']')
        } else {
            before_comment.find('=').is_some_and(|at| at > 0)
        }
    };
    let lines: Vec<&str> = text.split(['\n', '\r']).filter(is_sound).collect();
    lines.join("\n")
}

fn text_of<'a>(section: &'a Keys, key: &str) -> Option<&'a str> {
    section.get(key)?.as_deref().map(str::trim)
}

fn numbers(section: &Keys) -> HashMap<String, i64> {
    let parsed = |(key, value): (&String, &Option<String>)| {
        Some((key.clone(), plain(value.as_deref()?.trim())?))
    };
    section.iter().filter_map(parsed).collect()
}

fn object(section: &Keys) -> SheetObject {
    let stated = |key| text_of(section, key).and_then(number);
    let kind = match text_of(section, "datatype").and_then(plain) {
        // A Boolean takes a byte.
        Some(1 | 5) => Some(Kind::U8),
        Some(2) => Some(Kind::I8),
        Some(3) => Some(Kind::I16),
        Some(4) => Some(Kind::I32),
        Some(6) => Some(Kind::U16),
        Some(7) => Some(Kind::U32),
        _ => None,
    };
    let access = text_of(section, "accesstype").unwrap_or("").to_ascii_lowercase();
    SheetObject {
        kind,
        access: match access.as_str() {
            "wo" => Access::Write,
            "rw" | "rwr" | "rww" => Access::ReadWrite,
            _ => Access::Read,
        },
        is_mappable: stated("pdomapping") == Some(Number::Plain(1)),
        default: stated("defaultvalue"),
        configured: stated("parametervalue"),
    }
}
