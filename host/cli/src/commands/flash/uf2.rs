//! UF2 files: an image in blocks of 512 bytes, as the boot drive of the RP2040 takes it.
//!
//! Source: Microsoft, USB Flashing Format (UF2); RP2040 data sheet, 2.8.4.2 "UF2 Format Details".

use std::fs;
use std::path::{Path, PathBuf};

use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader as _, ProgramHeader as _};
use object::{Endianness, FileKind};

/// Where the flash of the RP2040 is for its processor.
const FLASH: std::ops::Range<u32> = 0x1000_0000..0x1100_0000;
/// Bytes of the image in a block: a page of the flash.
const PAGE: usize = 256;
const BLOCK: usize = 512;
const FAMILY_RP2040: u32 = 0xE48B_FF56;
const FLAG_FAMILY: u32 = 0x2000;
const BEGIN: [u32; 2] = [0x0A32_4655, 0x9E5D_5157];
const END: u32 = 0x0AB1_6F30;
/// The file by which a boot drive is recognised, and what is in it.
const INFO: (&str, &str) = ("INFO_UF2.TXT", "RPI-RP2");

/// Stretches of an ELF file that lie in the flash of an RP2040, by address; `None` for an image of another chip.
pub(super) fn segments(elf: &[u8]) -> Option<Vec<(u32, Vec<u8>)>> {
    if FileKind::parse(elf).ok()? != FileKind::Elf32 {
        return None;
    }
    let header = FileHeader32::<Endianness>::parse(elf).ok()?;
    let endian = header.endian().ok()?;
    let mut found = Vec::new();
    for segment in header.program_headers(endian, elf).ok()? {
        let bytes = segment.data(endian, elf).ok()?;
        if segment.p_type(endian) == PT_LOAD && !bytes.is_empty() {
            found.push((segment.p_paddr(endian), bytes.to_vec()));
        }
    }
    found.sort();
    let is_inside = |(address, _): &(u32, Vec<u8>)| FLASH.contains(address);
    (!found.is_empty() && found.iter().all(is_inside)).then_some(found)
}

/// The image as a UF2 file. Pages that two stretches share are merged; what no stretch has is 0xff.
pub(super) fn file(segments: &[(u32, Vec<u8>)]) -> Vec<u8> {
    let mut pages = std::collections::BTreeMap::<u32, [u8; PAGE]>::new();
    for (address, bytes) in segments {
        for (at, byte) in (*address..).zip(bytes) {
            pages.entry(at - at % PAGE as u32).or_insert([0xff; PAGE])[at as usize % PAGE] = *byte;
        }
    }
    let count = pages.len() as u32;
    let mut file = Vec::with_capacity(pages.len() * BLOCK);
    for (number, (address, page)) in (0u32..).zip(&pages) {
        let head = [BEGIN[0], BEGIN[1], FLAG_FAMILY, *address, PAGE as u32, number, count, FAMILY_RP2040];
        file.extend(head.iter().flat_map(|word| word.to_le_bytes()));
        file.extend(page);
        file.resize(file.len() + BLOCK - 32 - PAGE - 4, 0);
        file.extend(END.to_le_bytes());
    }
    file
}

/// The mounted boot drive, by the list of mounts at `mounts`.
pub(super) fn drive(mounts: &Path) -> Option<PathBuf> {
    let mounts = fs::read_to_string(mounts).ok()?;
    let folders = mounts.lines().filter_map(|line| line.split(' ').nth(1));
    // Blanks in names are written in octal digits.
    folders.map(|folder| PathBuf::from(folder.replace("\\040", " "))).find(|folder| is_drive(folder))
}

/// Whether the folder is that of a boot drive.
pub(super) fn is_drive(folder: &Path) -> bool {
    fs::read_to_string(folder.join(INFO.0)).is_ok_and(|info| info.contains(INFO.1))
}

#[cfg(test)]
mod tests {
    use super::{BLOCK, drive, file};

    #[test]
    fn a_page_is_a_block_and_two_stretches_share_one() {
        let uf2 = file(&[(0x1000_0000, vec![1; 256]), (0x1000_0100, vec![2; 3]), (0x1000_0180, vec![3; 1])]);
        assert_eq!(uf2.len(), 2 * BLOCK);
        assert_eq!(uf2[..8], [0x55, 0x46, 0x32, 0x0a, 0x57, 0x51, 0x5d, 0x9e]);
        assert_eq!(
            uf2[8..32],
            [0, 0x20, 0, 0, 0, 0, 0, 0x10, 0, 1, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0x56, 0xff, 0x8b, 0xe4]
        );
        let second = &uf2[BLOCK..];
        assert_eq!((second[12..16].to_vec(), second[20]), (vec![0, 1, 0, 0x10], 1));
        assert_eq!((&second[32..36], second[32 + 128], second[32 + 129]), (&[2, 2, 2, 0xff][..], 3, 0xff));
        assert_eq!(uf2[BLOCK - 4..BLOCK], [0x30, 0x6f, 0xb1, 0x0a]);
    }

    #[test]
    fn a_boot_drive_is_found_among_the_mounts() {
        let folder = tempfile::tempdir().unwrap();
        let (plain, boot) = (folder.path().join("plain"), folder.path().join("RPI RP2"));
        for folder in [&plain, &boot] {
            std::fs::create_dir(folder).unwrap();
        }
        let mounts = folder.path().join("mounts");
        let line = |folder: &std::path::Path| {
            format!("/dev/sda1 {} vfat rw 0 0\n", folder.display().to_string().replace(' ', "\\040"))
        };
        std::fs::write(&mounts, line(&plain) + &line(&boot)).unwrap();
        assert_eq!(drive(&mounts), None);
        std::fs::write(boot.join("INFO_UF2.TXT"), "UF2 Bootloader v3.0\r\nBoard-ID: RPI-RP2\r\n").unwrap();
        assert_eq!(drive(&mounts), Some(boot));
    }
}
