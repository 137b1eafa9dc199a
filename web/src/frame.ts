/** Samples of a subscription: the binary frames of the WebSocket. All numbers are little endian. */

import { FRAME_HEADER_BYTES, FRAME_VERSION, KIND_DECIMATED, KIND_FULL } from "./protocol.ts";

interface FrameHead {
  id: number; // of the subscription
  rows: number;
  lost: number; // rows that were lost before this frame
  first: number; // number of the first cycle
  period: number; // [s]
  time: Float64Array; // [s], one per row
}

/** Every sample: `columns[signal][row]`. */
export interface FullFrame extends FrameHead {
  kind: typeof KIND_FULL;
  columns: Float64Array[];
}

/** Smallest and largest sample in each interval: `minimum[signal][row]`, `maximum[signal][row]`. */
export interface DecimatedFrame extends FrameHead {
  kind: typeof KIND_DECIMATED;
  minimum: Float32Array[];
  maximum: Float32Array[];
}

export type Frame = FullFrame | DecimatedFrame;

/** Decode a frame without copying. Throws RangeError if the frame is too short or of another version. */
export function decodeFrame(buffer: ArrayBuffer): Frame {
  const view = new DataView(buffer);
  const kind = view.getUint8(0);
  if (view.getUint8(1) !== FRAME_VERSION) throw new RangeError("frame of another version");
  const rows = view.getUint32(4, true);
  const signals = view.getUint32(8, true);
  const head: FrameHead = {
    id: view.getUint16(2, true),
    rows,
    lost: view.getUint32(12, true),
    first: view.getFloat64(16, true),
    period: view.getFloat64(24, true),
    time: new Float64Array(buffer, FRAME_HEADER_BYTES, rows),
  };
  const start = FRAME_HEADER_BYTES + 8 * rows;
  const places = Array.from({ length: signals }, (_, signal) => start + 8 * rows * signal);
  if (kind === KIND_FULL) {
    return { ...head, kind, columns: places.map((at) => new Float64Array(buffer, at, rows)) };
  }
  if (kind !== KIND_DECIMATED) throw new RangeError(`unknown kind of frame: ${kind}`);
  return {
    ...head,
    kind,
    minimum: places.map((at) => new Float32Array(buffer, at, rows)),
    maximum: places.map((at) => new Float32Array(buffer, at + 4 * rows, rows)),
  };
}
