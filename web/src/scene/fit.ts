/** Distance of the camera from which the robot fills the view. */

import { Box3, type Group, MathUtils, type Mesh, type PerspectiveCamera, Vector3 } from "three";

/** Direction from the robot to the camera. */
export const VIEW = new Vector3(1.1, -1.5, 0.7).normalize();

const HEIGHT = 0.66; // part of the view that the robot fills at most
const WIDTH = 0.8;

/** Return the corners of the boxes around the shapes of the robot, in the world [m]. */
export function cornersOf(bodies: readonly Group[]): Vector3[] {
  const [world, ...moving] = bodies.map((body) => body.children.filter(isSolid).flatMap(corners));
  const robot = moving.flat();
  const size = sizeOf(robot);
  const near = sizeOf(world ?? []) <= 2 * size ? world : []; // a stand, not a hall
  return [...robot, ...(near ?? [])];
}

/** Return the distance from the target [m] at which all corners are in the view; 0 without corners. */
export function distanceFor(corners: readonly Vector3[], target: Vector3, camera: PerspectiveCamera): number {
  const up = Math.tan(MathUtils.degToRad(camera.fov / 2));
  const right = new Vector3(0, 0, 1).cross(VIEW).normalize();
  const top = VIEW.clone().cross(right);
  const distances = corners.map((corner) => {
    const from = corner.clone().sub(target);
    const high = Math.abs(from.dot(top)) / (HEIGHT * up);
    const wide = Math.abs(from.dot(right)) / (WIDTH * up * camera.aspect);
    return from.dot(VIEW) + Math.max(high, wide);
  });
  return Math.max(0, ...distances);
}

function isSolid(object: Group["children"][number]): boolean {
  return object.userData.isPlane === false;
}

function corners(object: Group["children"][number]): Vector3[] {
  const { geometry } = object as Mesh;
  geometry.computeBoundingBox();
  object.updateWorldMatrix(true, false);
  const { min, max } = geometry.boundingBox!;
  return [min.x, max.x].flatMap((x) =>
    [min.y, max.y].flatMap((y) =>
      [min.z, max.z].map((z) => object.localToWorld(new Vector3(x, y, z)))));
}

function sizeOf(points: Vector3[]): number {
  return points.length === 0 ? 0 : new Box3().setFromPoints(points).getSize(new Vector3()).length();
}
