//! The tables of the protocols for other people's tools: DBC, Wireshark, JSON, Markdown.
