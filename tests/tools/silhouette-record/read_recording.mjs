// SPDX-License-Identifier: Apache-2.0
// Reads a recording with the libraries that Foxglove reads it with, decodes each message by the
// descriptors in the file alone, and prints what it found as JSON.
//   node read_recording.mjs FILE [--cut]     --cut: from its beginning, without its index
import fs from 'node:fs';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';
import { loadDecompressHandlers } from '@mcap/support';
import protobuf from 'protobufjs';
import descriptor from 'protobufjs/ext/descriptor/index.js';

const [file, cut] = process.argv.slice(2);
const decompressHandlers = await loadDecompressHandlers();
const schemas = new Map();
const channels = new Map();
const types = new Map();
const found = { library: '', indexed: !cut, topics: {}, scenes: [], paths: [] };

function typeOf(schema) {
  if (!types.has(schema.id)) {
    if (schema.encoding !== 'protobuf') throw new Error('schema encoding ' + schema.encoding);
    const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
    root.resolveAll();
    types.set(schema.id, root.lookupType(schema.name));
  }
  return types.get(schema.id);
}

function take(message) {
  const channel = channels.get(message.channelId);
  if (channel.messageEncoding !== 'protobuf') throw new Error(channel.messageEncoding);
  const type = typeOf(schemas.get(channel.schemaId));
  const value = type.toObject(type.decode(message.data), {
    longs: Number, enums: String, bytes: String, defaults: true });
  found.topics[channel.topic] = (found.topics[channel.topic] ?? 0) + 1;
  if (channel.topic === '/scene') found.scenes.push(value);
  if (channel.topic === '/path') found.paths.push(value.answer?.check?.verdict?.state ?? 'ended');
  if (channel.topic === '/database') found.cell = value.cell_name;
}

if (cut) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(fs.readFileSync(file));
  for (let record; (record = reader.nextRecord()) !== undefined; ) {
    if (record.type === 'Schema') schemas.set(record.id, record);
    if (record.type === 'Channel') channels.set(record.id, record);
    if (record.type === 'Message') take(record);
  }
} else {
  const handle = fs.openSync(file);
  const readable = {
    size: async () => BigInt(fs.fstatSync(handle).size),
    read: async (offset, size) => {
      const bytes = new Uint8Array(Number(size));
      fs.readSync(handle, bytes, 0, bytes.length, Number(offset));
      return bytes;
    },
  };
  // It checks the checksums of summary and chunks.
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  found.library = reader.header.library;
  found.chunks = reader.chunkIndexes.length;
  found.count = Number(reader.statistics.messageCount);
  reader.schemasById.forEach((schema, id) => schemas.set(id, schema));
  reader.channelsById.forEach((channel, id) => channels.set(id, channel));
  for await (const message of reader.readMessages({ validateCrcs: true })) take(message);
}
console.log(JSON.stringify(found));
