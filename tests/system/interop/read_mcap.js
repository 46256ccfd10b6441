// read_mcap.js FILE: prints, as JSON, the contents of a recording in an independent reader: channels with their
// counts, and some messages. With the index if the file has one, else from its beginning.
const fs = require("fs");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");

class FileReadable {
  constructor(bytes) { this.bytes = bytes; }
  async size() { return BigInt(this.bytes.length); }
  async read(offset, size) {
    if (offset + size > BigInt(this.bytes.length)) throw new Error("beyond the end");
    return new Uint8Array(this.bytes.buffer, this.bytes.byteOffset + Number(offset), Number(size));
  }
}

const out = { indexed: false, schemas: {}, channels: {}, attachments: 0, first: {} };
const kKept = 200; // messages of each channel, decoded by the definition in the file
const readers = new Map();

function decode(channel, schema, data) {
  if (!readers.has(channel.id)) {
    const definition = new TextDecoder().decode(schema.data);
    readers.set(channel.id, new MessageReader(parse(definition, { ros2: true })));
  }
  const plain = (key, value) =>
    typeof value === "bigint" ? Number(value) : ArrayBuffer.isView(value) ? Array.from(value) : value;
  return JSON.parse(JSON.stringify(readers.get(channel.id).readMessage(data), plain));
}

function take(channels, schemas, message) {
  const channel = channels.get(message.channelId);
  const entry = (out.channels[channel.topic] ??= { messages: 0, encoding: channel.messageEncoding, metadata: Object.fromEntries(channel.metadata) });
  ++entry.messages;
  const first = (out.first[channel.topic] ??= []);
  if (first.length < kKept) first.push(decode(channel, schemas.get(channel.schemaId), message.data));
}

async function main() {
  const bytes = fs.readFileSync(process.argv[2]);
  try {
    const reader = await McapIndexedReader.Initialize({ readable: new FileReadable(bytes) });
    out.indexed = true;
    for (const schema of reader.schemasById.values()) out.schemas[schema.name] = schema.encoding;
    let last = 0n;
    for await (const message of reader.readMessages({ validateCrcs: true })) {
      if (message.logTime < last) throw new Error("out of order");
      last = message.logTime;
      take(reader.channelsById, reader.schemasById, message);
    }
    for await (const each of reader.readAttachments({ validateCrcs: true })) out.attachments += each.data.length > 0 ? 1 : 0;
    out.statistics = Number(reader.statistics.messageCount);
  } catch (error) {
    if (out.indexed) throw error;
    const reader = new McapStreamReader({ validateCrcs: true });
    reader.append(bytes);
    const channels = new Map(), schemas = new Map();
    for (let record; (record = reader.nextRecord()); ) {
      if (record.type === "Channel") channels.set(record.id, record);
      if (record.type === "Schema") schemas.set(record.id, record), (out.schemas[record.name] = record.encoding);
      if (record.type === "Message") take(channels, schemas, record);
    }
  }
  console.log(JSON.stringify(out));
}

main().catch((error) => { console.error(error); process.exit(1); });
