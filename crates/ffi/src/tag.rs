//! What the storage of an object begins with: a number for each kind.

macro_rules! tags {
    ($( $name:ident $tag:literal; )+) => {
        $( pub(crate) const $name: u32 = $tag; )+

        /// The tags of all kinds.
        pub(crate) const ALL: [u32; [$($name),+].len()] = [$($name),+];
    };
}

tags! {
    ST_SLAVE 0x5EA1_51A7;
    ST_MASTER 0x3A57_C0DE;
    RMD_HOST 0x7B05_1D1E;
    RMD_DRIVE 0x2D21_7E11;
    SLCAN_HOST 0x51CA_4057;
    SLCAN_DEVICE 0x51CA_DEF1;
}

#[cfg(test)]
mod tests {
    use super::ALL;

    #[test]
    fn no_tag_is_another_one_or_its_complement() {
        for (index, tag) in ALL.iter().enumerate() {
            assert!(ALL.iter().skip(index + 1).all(|other| tag != other && *tag != !other));
        }
    }
}
