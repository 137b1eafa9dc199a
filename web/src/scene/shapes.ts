/** Shapes of a scene as objects of three.js. */

import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CapsuleGeometry,
  Color,
  CylinderGeometry,
  Mesh,
  MeshLambertMaterial,
  type Material,
  PlaneGeometry,
  SphereGeometry,
} from "three";
import type { Mesh as MeshData, SceneData, Shape } from "./decode.ts";

const INFINITE = 20; // [m]: half length of a plane without limits
const GHOST_OPACITY = 0.28;

/** Return an object for a shape, relative to its body. */
export function objectOf(shape: Shape, scene: SceneData, ghost: boolean): Mesh {
  const object = new Mesh(geometryOf(shape, scene.meshes), materialOf(shape, ghost));
  const [w, x, y, z] = shape.quaternion as [number, number, number, number];
  object.position.fromArray(shape.position);
  object.quaternion.set(x, y, z, w);
  object.userData.body = shape.body;
  object.userData.isPlane = shape.type === "plane";
  return object;
}

function geometryOf(shape: Shape, meshes: MeshData[]): BufferGeometry {
  const [x = 0, y = 0, z = 0] = shape.size;
  if (shape.type === "box") return new BoxGeometry(2 * x, 2 * y, 2 * z);
  if (shape.type === "plane") return new PlaneGeometry(2 * (x || INFINITE), 2 * (y || INFINITE));
  if (shape.type === "capsule") return new CapsuleGeometry(x, 2 * y, 8, 24).rotateX(Math.PI / 2);
  if (shape.type === "cylinder") return new CylinderGeometry(x, x, 2 * y, 32).rotateX(Math.PI / 2);
  if (shape.type === "sphere") return new SphereGeometry(x, 32, 20);
  if (shape.type === "ellipsoid") return new SphereGeometry(1, 32, 20).scale(x, y, z);
  const mesh = meshes[shape.mesh];
  return mesh === undefined ? new BufferGeometry() : meshGeometry(mesh);
}

function meshGeometry(mesh: MeshData): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(mesh.vertices, 3));
  geometry.setIndex(new BufferAttribute(mesh.faces, 1));
  geometry.computeVertexNormals();
  return geometry;
}

function materialOf(shape: Shape, ghost: boolean): Material {
  const [red = 0.5, green = 0.5, blue = 0.5, alpha = 1] = shape.colour;
  const opacity = ghost ? GHOST_OPACITY : alpha;
  return new MeshLambertMaterial({
    color: ghost ? new Color(0.25, 0.6, 1) : new Color().setRGB(red, green, blue, "srgb"),
    transparent: opacity < 1,
    opacity,
    depthWrite: opacity >= 1,
    flatShading: shape.type === "mesh",
    polygonOffset: ghost, // hidden where it coincides with the robot
    polygonOffsetFactor: 2,
    polygonOffsetUnits: 2,
  });
}
