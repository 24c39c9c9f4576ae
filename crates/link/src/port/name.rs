//! Why a string is not the name of a port, and what all names share.

use crate::text::{is_printable, printable};

/// Why a string is not the name of a port.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NameError {
    /// No form has this beginning.
    #[error("`{name}` is not the name of a port; {}{forms}", suggestion(.nearest.as_deref()))]
    UnknownForm {
        /// The given name.
        name: String,
        /// A similar valid name.
        nearest: Option<String>,
        /// The valid forms.
        forms: String,
    },
    /// A serial port or a CAN adapter as Windows names it: `COM3`, `PCAN_USBBUS1`.
    #[error("`{name}` is a port of Windows, and this system is not Windows")]
    Windows {
        /// The given name.
        name: String,
    },
    /// It has characters that a terminal does not show as they are.
    #[error("`{name}` is not a port name: it has control characters")]
    Unprintable {
        /// What was given, without these characters.
        name: String,
    },
    /// The part after the scheme is missing.
    #[error("`{name}` lacks {what}; write it like {example}")]
    Incomplete {
        /// The given name.
        name: String,
        /// What is missing.
        what: &'static str,
        /// A valid name.
        example: &'static str,
    },
    /// The part after `slcan:` is not a port for bytes.
    #[error("`{name}`: there is no serial line at `{behind}` for the adapter")]
    NoLineBehind {
        /// The given name.
        name: String,
        /// The part after the scheme.
        behind: String,
    },
    /// An option that this form does not have.
    #[error("`{name}` has the unknown option `{key}`; valid options: {known}")]
    UnknownOption {
        /// The given name.
        name: String,
        /// The option.
        key: String,
        /// The valid options.
        known: String,
    },
    /// An option that is given twice.
    #[error("`{name}` has the option `{key}` twice")]
    OptionTwice {
        /// The given name.
        name: String,
        /// The option.
        key: String,
    },
    /// An option with an invalid value.
    #[error("`{name}`: {key} cannot be `{value}`; use {usable}")]
    BadOption {
        /// The given name.
        name: String,
        /// The option.
        key: &'static str,
        /// Its value.
        value: String,
        /// The valid values.
        usable: String,
    },
}

pub(crate) fn unknown_form(name: &str, nearest: Option<String>, forms: String) -> NameError {
    NameError::UnknownForm { name: name.to_owned(), nearest, forms }
}

fn suggestion(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |nearest| format!("did you mean `{nearest}`? "))
}

/// Refuses a name that cannot be shown as it is.
pub(crate) fn check_printable(name: &str) -> Result<(), NameError> {
    match name.chars().all(is_printable) {
        true => Ok(()),
        false => Err(NameError::Unprintable { name: printable(name) }),
    }
}

pub(crate) fn present<'a>(
    name: &str,
    part: &'a str,
    what: &'static str,
    example: &'static str,
) -> Result<&'a str, NameError> {
    if part.is_empty() {
        return Err(NameError::Incomplete { name: name.to_owned(), what, example });
    }
    Ok(part)
}

pub(crate) fn host_and_port(
    name: &str,
    address: &str,
    example: &'static str,
) -> Result<(String, u16), NameError> {
    let lacks = |what| NameError::Incomplete { name: name.to_owned(), what, example };
    let (host, port) = address.rsplit_once(':').ok_or_else(|| lacks("a TCP port"))?;
    if host.contains(':') && !(host.starts_with('[') && host.ends_with(']')) {
        return Err(lacks("the brackets around its IPv6 address"));
    }
    let host = present(name, host, "a host", example)?;
    let port = port.parse().map_err(|_| lacks("a TCP port from 0 to 65535"))?;
    Ok((host.to_owned(), port))
}
