//! Parts of documents that are derived from the source: compared, or rewritten with `ILC_DERIVE=1`.

/// Compares the part of a document between `<!-- derived: NAME -->` and `<!-- end -->` with `text`.
///
/// # Panics
/// If they differ, or the document lacks this part.
pub fn hold_derived(document: &str, name: &str, text: &str) {
    let path = crate::root().join(document);
    let whole = std::fs::read_to_string(&path).expect("the document is there");
    let begin = format!("<!-- derived: {name} -->\n");
    let from =
        whole.find(&begin).unwrap_or_else(|| panic!("{document} has no {begin}")) + begin.len();
    let len = whole[from..].find("<!-- end -->").expect("a derived part ends");
    if &whole[from..from + len] == text {
        return;
    }
    assert!(
        std::env::var_os("ILC_DERIVE").is_some(),
        "{document}: {name} is not what the source says; `make derived` writes it"
    );
    let written = format!("{}{text}{}", &whole[..from], &whole[from + len..]);
    std::fs::write(&path, written).expect("the document can be written");
}

/// Holds a whole derived file against `text`.
///
/// # Panics
/// If they differ.
pub fn hold_derived_file(document: &str, text: &str) {
    let path = crate::root().join(document);
    if std::fs::read_to_string(&path).is_ok_and(|found| found == text) {
        return;
    }
    assert!(
        std::env::var_os("ILC_DERIVE").is_some(),
        "{document} is not what the source says; `make derived` writes it"
    );
    std::fs::write(&path, text).expect("the file can be written");
}
