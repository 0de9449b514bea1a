//! Device memory accounting.

use super::super::memory::{Buffer, Purpose};
use super::super::transfer::{Uploader, download};
use super::*;

#[test]
fn transfers_larger_than_the_staging_buffer_arrive_whole() {
    on_device(|device| {
        let words: Vec<u32> = (0..20_000_001).collect();
        let bytes: &[u8] = bytemuck::cast_slice(&words);
        let buffer = Buffer::new(device, "words", bytes.len() as u64, Purpose::ShaderData).expect("fits");
        let mut uploader = Uploader::new(device, bytes.len() as u64).expect("fits");
        let (first, second) = bytes.split_at(12_345_676);
        uploader.write(&buffer, 12_345_676, second).expect("written");
        uploader.write(&buffer, 0, first).expect("written");
        uploader.flush().expect("written");
        drop(uploader);
        let mut back = Vec::new();
        download(device, &buffer, words.len(), |w: &u32| back.push(*w)).expect("read");
        assert!(back == words);
    });
}

#[test]
fn an_allocation_too_large_is_refused_by_name_and_size() {
    on_device(|device| {
        let limit = device.info().limits.max_allocation;
        let error = Buffer::new(device, "the whole world", limit + 1, Purpose::ShaderData).err().expect("too large");
        assert!(matches!(&error, Error::Limit { what, .. } if what.contains("the whole world")), "{error}");
    });
}

#[test]
fn running_out_of_memory_is_an_error_that_names_the_object_and_its_size() {
    on_unchecked_device(|device| {
        device.limits_mut().max_allocation = u64::MAX;
        let error = Buffer::new(device, "the whole world", 1 << 50, Purpose::ShaderData).err().expect("too large");
        assert!(matches!(&error, Error::OutOfMemory { bytes, .. } if *bytes == 1 << 50), "{error}");
        assert!(error.to_string().ends_with("memory for the whole world (1048576.00 GiB)"), "{error}");
    });
}
