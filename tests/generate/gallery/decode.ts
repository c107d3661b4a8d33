// Decode samples with the gallery's module. Each input line is `Name hex`; the output line has all its values.
import { readFileSync } from "node:fs";
import * as messages from "./messages.ts";

type Decoder = { decode(sample: Uint8Array): object };

function* values(value: unknown): Generator<string> {
  if (typeof value === "object") {
    for (const inner of Object.values(value!)) yield* values(inner);
  } else if (typeof value === "boolean" || Number.isInteger(value)) {
    yield `${BigInt(value as boolean | number)}`; // all digits, where JavaScript would round them
  } else {
    yield `${value}`;
  }
}

for (const line of readFileSync(0, "utf8").trim().split("\n")) {
  const [name, hex] = line.split(" ");
  const decoder = (messages as unknown as Record<string, Decoder>)[name!]!;
  try {
    console.log([...values(decoder.decode(Buffer.from(hex!, "hex")))].join(" "));
  } catch (error) {
    if (!(error instanceof RangeError)) throw error;
    console.log("refused");
  }
}
