/** Binary data of the 3D scene. The format is described in src/catenary/dashboard/scene.py. */

import { KIND_POSES } from "../protocol.ts";

export type ShapeType =
  | "plane" | "height field" | "sphere" | "capsule" | "ellipsoid" | "cylinder" | "box" | "mesh";

export interface Shape {
  type: ShapeType;
  body: number;
  mesh: number; // -1: none
  size: number[]; // half lengths [m]
  position: number[]; // relative to the body [m]
  quaternion: number[]; // w, x, y, z
  colour: number[]; // red, green, blue, opacity; 0 to 1
}

export interface Mesh {
  vertices: Float32Array; // x, y, z of each vertex [m]
  faces: Uint32Array; // three vertices of each face
}

export interface SceneDescription {
  bodies: string[];
  joints: (string | null)[];
  center: [number, number, number];
  extent: number; // [m]
}

export interface SceneData extends SceneDescription {
  shapes: Shape[];
  meshes: Mesh[];
}

/** Poses at one time. Each row: position [m] and quaternion (w, x, y, z) of a body. */
export interface Poses {
  time: number; // [s]
  actual: Float32Array;
  target: Float32Array;
  contacts: Float32Array; // position and normal of each contact
}

export const POSE_SIZE = 7;
export const CONTACT_SIZE = 6;
const MAGIC = "CATSCENE";
const HEAD = 32; // bytes
const SHAPE = 72; // bytes
const TYPES: ShapeType[] = [
  "plane", "height field", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh",
];

/** Decode a scene. Throws RangeError for other data. */
export function decodeScene(buffer: ArrayBuffer): SceneData {
  const view = new DataView(buffer);
  const text = new TextDecoder();
  const head = Array.from({ length: 5 }, (_, index) => view.getUint32(8 + 4 * index, true));
  const [version, bodies, shapeCount, meshCount, length] = head as [number, number, number, number, number];
  if (text.decode(new Uint8Array(buffer, 0, 8)) !== MAGIC || version !== 1) {
    throw new RangeError("not a scene of version 1");
  }
  const description = JSON.parse(text.decode(new Uint8Array(buffer, HEAD, length))) as SceneDescription;
  const start = HEAD + length;
  const shapes = Array.from({ length: shapeCount }, (_, index) => shapeAt(view, start + index * SHAPE));
  const meshes = meshesAt(view, start + shapeCount * SHAPE, meshCount);
  if (description.bodies.length !== bodies) throw new RangeError("the scene contradicts itself");
  return { ...description, shapes, meshes };
}

function shapeAt(view: DataView, at: number): Shape {
  const floats = (offset: number, count: number): number[] =>
    Array.from({ length: count }, (_, index) => view.getFloat32(at + offset + 4 * index, true));
  const type = TYPES[view.getUint32(at, true)];
  if (type === undefined) throw new RangeError("the scene has an unknown shape");
  return {
    type,
    body: view.getUint32(at + 4, true),
    mesh: view.getInt32(at + 8, true),
    size: floats(16, 3),
    position: floats(28, 3),
    quaternion: floats(40, 4),
    colour: floats(56, 4),
  };
}

function meshesAt(view: DataView, start: number, count: number): Mesh[] {
  let at = start;
  return Array.from({ length: count }, () => {
    const vertices = view.getUint32(at, true);
    const faces = view.getUint32(at + 4, true);
    const first = at + 8;
    const second = first + 12 * vertices;
    at = second + 12 * faces;
    return {
      vertices: new Float32Array(view.buffer as ArrayBuffer, first, 3 * vertices),
      faces: new Uint32Array(view.buffer as ArrayBuffer, second, 3 * faces),
    };
  });
}

/** Decode poses without copying. Throws RangeError for other data. */
export function decodePoses(buffer: ArrayBuffer): Poses {
  const view = new DataView(buffer);
  if (view.getUint8(0) !== KIND_POSES || view.getUint8(1) !== 1) {
    throw new RangeError("not poses of version 1");
  }
  const bodies = view.getUint32(4, true);
  const contacts = view.getUint16(2, true);
  const floats = (offset: number, count: number) => new Float32Array(buffer, HEAD + 4 * offset, count);
  return {
    time: view.getFloat64(16, true),
    actual: floats(0, POSE_SIZE * bodies),
    target: floats(POSE_SIZE * bodies, POSE_SIZE * bodies),
    contacts: floats(2 * POSE_SIZE * bodies, CONTACT_SIZE * contacts),
  };
}
