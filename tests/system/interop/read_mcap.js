// read_mcap.js FILE: what an independent reader makes of a recording, as JSON: channels with their counts, and some messages.
// With the index where the file has one, else from its beginning.
const fs = require("fs");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");

class FileReadable {
  constructor(bytes) { this.bytes = bytes; }
  async size() { return BigInt(this.bytes.length); }
  async read(offset, size) {
    if (offset + size > BigInt(this.bytes.length)) throw new Error("beyond the end");
    return new Uint8Array(this.bytes.buffer, this.bytes.byteOffset + Number(offset), Number(size));
  }
}

const out = { indexed: false, schemas: {}, channels: {}, attachments: 0, wrenches: [] };

// geometry_msgs/WrenchStamped in CDR: head, stamp, frame_id, then doubles aligned to 8 behind the head.
function wrench(data) {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const length = view.getUint32(12, true);
  const name = Buffer.from(data.subarray(16, 16 + length - 1)).toString();
  let at = 4 + Math.ceil((12 + length) / 8) * 8;
  const numbers = [];
  for (let i = 0; i < 6; ++i, at += 8) numbers.push(view.getFloat64(at, true));
  return { sec: view.getInt32(4, true), frame_id: name, numbers, rest: data.byteLength - at };
}

function take(channels, message) {
  const channel = channels.get(message.channelId);
  const entry = (out.channels[channel.topic] ??= { messages: 0, encoding: channel.messageEncoding, metadata: Object.fromEntries(channel.metadata) });
  ++entry.messages;
  if (channel.topic.endsWith("/wrench") && out.wrenches.length < 50) out.wrenches.push(wrench(message.data));
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
      take(reader.channelsById, message);
    }
    for await (const each of reader.readAttachments({ validateCrcs: true })) out.attachments += each.data.length > 0 ? 1 : 0;
    out.statistics = Number(reader.statistics.messageCount);
  } catch (error) {
    if (out.indexed) throw error;
    const reader = new McapStreamReader({ validateCrcs: true });
    reader.append(bytes);
    const channels = new Map();
    for (let record; (record = reader.nextRecord()); ) {
      if (record.type === "Channel") channels.set(record.id, record);
      if (record.type === "Schema") out.schemas[record.name] = record.encoding;
      if (record.type === "Message") take(channels, record);
    }
  }
  console.log(JSON.stringify(out));
}

main().catch((error) => { console.error(error); process.exit(1); });
