//! Writes what could be read of a recording into a new file, with an index.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, Write};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Compression, McapError, WriteOptions};

use super::record::Attachment;
use super::record::HEAD;
use super::recording::Recording;

/// The metadata record of a repaired file.
const RECOVERED: &str = "recovered";

impl<R: Read + Seek> Recording<R> {
    /// Writes all that can be read into a new, finished file: channels, messages, metadata and
    /// attachments. If something is lost, metadata named `recovered` say so. Returns the number of
    /// messages.
    ///
    /// # Errors
    /// A file cannot be read or written.
    pub fn write_to(&mut self, out: impl Write) -> io::Result<u64> {
        let mut writer = WriteOptions::new()
            .profile(&*self.profile)
            .library(&*self.library)
            .compression(Some(Compression::Zstd))
            .disable_seeking(true)
            .create(NoSeek::new(out))
            .map_err(failed)?;
        for metadata in self.metadata.iter().filter(|metadata| metadata.name != RECOVERED) {
            let (name, metadata) = (metadata.name.clone(), metadata.values.clone());
            let record = mcap::records::Metadata { name, metadata };
            writer.write_metadata(&record).map_err(failed)?;
        }
        for at in self.attachments.iter().map(|place| place.at.clone()).collect::<Vec<_>>() {
            let body = at.start + HEAD as u64;
            let bytes = self.source.bytes(body, at.end.saturating_sub(body))?;
            let Some(Attachment { name, media_type, log_time, create_time, data }) =
                Attachment::parse(bytes)
            else {
                continue;
            };
            let data = data.into();
            let attachment = mcap::Attachment { log_time, create_time, name, media_type, data };
            writer.attach(&attachment).map_err(failed)?;
        }
        for schema in self.catalogue.schemas.values() {
            writer
                .add_schema_with_id(schema.id, &schema.name, &schema.encoding, &schema.data)
                .map_err(failed)?;
        }
        for channel in self.catalogue.channels.values() {
            // A schema that was lost is not named.
            let is_known = self.catalogue.schemas.contains_key(&channel.schema_id);
            let schema = if is_known { channel.schema_id } else { 0 };
            let (topic, encoding) = (&channel.topic, &channel.encoding);
            writer
                .add_channel_with_id(channel.id, schema, topic, encoding, &channel.metadata)
                .map_err(failed)?;
        }
        let mut count = 0;
        for message in self.messages() {
            let message = message?;
            let header = MessageHeader {
                channel_id: message.channel.id,
                sequence: message.sequence,
                log_time: message.log_time,
                publish_time: message.publish_time,
            };
            writer.write_to_known_channel(&header, message.data()).map_err(failed)?;
            count += 1;
        }
        if !self.losses.is_empty() {
            let values = BTreeMap::from([
                ("lost_bytes".to_owned(), self.lost_bytes().to_string()),
                ("messages".to_owned(), count.to_string()),
                ("why".to_owned(), self.losses[0].damage.to_string()),
            ]);
            let name = RECOVERED.to_owned();
            let record = mcap::records::Metadata { name, metadata: values };
            writer.write_metadata(&record).map_err(failed)?;
        }
        writer.finish().map_err(failed)?;
        let mut out = writer.into_inner().into_inner();
        out.flush()?;
        Ok(count)
    }

    /// Bytes of the file that could not be read.
    pub fn lost_bytes(&self) -> u64 {
        self.losses.iter().map(|loss| loss.bytes.end - loss.bytes.start).sum()
    }
}

fn failed(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        error => io::Error::other(error),
    }
}
