/** 3D view of a robot: bodies at their poses, the targets as a ghost, contacts. */

import {
  AmbientLight,
  Box3,
  BufferAttribute,
  BufferGeometry,
  DirectionalLight,
  GridHelper,
  Group,
  LineBasicMaterial,
  LineSegments,
  PerspectiveCamera,
  Plane,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { CONTACT_SIZE, POSE_SIZE, type Poses, type SceneData } from "./decode.ts";
import { cornersOf, distanceFor, VIEW } from "./fit.ts";
import { objectOf } from "./shapes.ts";

export interface Push {
  body: number;
  point: [number, number, number]; // in the frame of the body [m]
  force: [number, number, number]; // in the frame of the world [N]
}

const STIFFNESS = 300; // [N/m] between the pointer and the body
const LARGEST_FORCE = 150; // [N]
const PUSH_INTERVAL = 50; // [ms]
const MAX_CONTACTS = 256;

/** Owns the WebGL context and the objects of one scene. */
export class Viewer {
  onPush: ((push: Push) => void) | null = null;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera: PerspectiveCamera;
  private readonly controls: OrbitControls;
  private readonly actual: Group[];
  private readonly ghosts: Group[];
  private readonly ghost = new Group();
  private readonly contacts: LineSegments;
  private readonly observer: ResizeObserver;
  private held: { body: number; point: Vector3; plane: Plane; goal: Vector3 } | null = null;
  private repeating: ReturnType<typeof setInterval> | undefined;
  private requested = 0;
  private fitted = false;

  constructor(private readonly element: HTMLElement, private readonly data: SceneData) {
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    element.append(this.renderer.domElement);
    this.camera = new PerspectiveCamera(40, 1, data.extent / 100, data.extent * 100);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.request());
    this.actual = this.bodies(false, this.scene);
    this.ghosts = this.bodies(true, this.ghost);
    this.contacts = contactLines();
    this.scene.add(this.ghost, this.contacts);
    this.addSurroundings();
    this.resetCamera();
    this.addPointer();
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(element);
  }

  /** Show the poses of one time. */
  show(poses: Poses): void {
    place(this.actual, poses.actual);
    place(this.ghosts, poses.target);
    this.fitOnce();
    this.showContacts(poses.contacts);
    this.request();
  }

  showGhost(visible: boolean): void {
    this.ghost.visible = visible;
    this.request();
  }

  /** Look at the whole robot in its present pose. */
  resetCamera(): void {
    const corners = cornersOf(this.actual);
    const target = new Box3().setFromPoints(corners).getCenter(new Vector3());
    if (corners.length === 0) target.set(...this.data.center);
    const distance = distanceFor(corners, target, this.camera) || this.data.extent * 2;
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(target).addScaledVector(VIEW, distance);
    this.controls.target.copy(target);
    this.controls.update();
    this.request();
  }

  dispose(): void {
    this.letGo();
    cancelAnimationFrame(this.requested);
    this.observer.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.domElement.remove();
  }

  /** Fit the camera to the first poses, as soon as the size of the view is known. */
  private fitOnce(): void {
    if (this.fitted || this.element.clientHeight === 0) return;
    this.fitted = true;
    this.resize();
    this.resetCamera();
  }

  private bodies(ghost: boolean, parent: Scene | Group): Group[] {
    const groups = this.data.bodies.map(() => new Group());
    for (const shape of this.data.shapes) {
      if (ghost && shape.body === 0) continue;
      groups[shape.body]?.add(objectOf(shape, this.data, ghost));
    }
    parent.add(...groups);
    return groups;
  }

  private addSurroundings(): void {
    const light = new DirectionalLight(0xffffff, 2.2);
    light.position.set(2, -3, 5);
    const size = Math.max(1, Math.ceil(this.data.extent * 2));
    const grid = new GridHelper(2 * size, 4 * size, 0x7d8792, 0x7d8792);
    grid.material.transparent = true;
    grid.material.opacity = 0.3;
    grid.rotation.x = Math.PI / 2;
    this.scene.add(light, new AmbientLight(0xffffff, 1.4), grid);
  }

  private showContacts(contacts: Float32Array): void {
    const count = Math.min(contacts.length / CONTACT_SIZE, MAX_CONTACTS);
    const positions = this.contacts.geometry.getAttribute("position") as BufferAttribute;
    const length = this.data.extent * 0.08;
    for (let index = 0; index < count; index++) {
      const [x = 0, y = 0, z = 0, u = 0, v = 0, w = 0] = contacts.subarray(index * CONTACT_SIZE);
      positions.setXYZ(2 * index, x, y, z);
      positions.setXYZ(2 * index + 1, x + u * length, y + v * length, z + w * length);
    }
    this.contacts.geometry.setDrawRange(0, 2 * count);
    positions.needsUpdate = true;
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.element;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(clientWidth, clientHeight);
    this.request();
  }

  private request(): void {
    if (this.requested !== 0) return;
    this.requested = requestAnimationFrame(() => {
      this.requested = 0;
      this.renderer.render(this.scene, this.camera);
    });
  }

  private addPointer(): void {
    const canvas = this.renderer.domElement;
    canvas.addEventListener("pointerdown", (event) => this.grab(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      canvas.addEventListener(kind, () => this.letGo());
    }
  }

  private grab(event: PointerEvent): void {
    if (this.onPush === null || event.button !== 0) return;
    const hit = this.ray(event).intersectObjects(this.actual.slice(1), true)[0];
    if (hit === undefined) return;
    const body = hit.object.userData.body as number;
    const normal = this.camera.getWorldDirection(new Vector3());
    const plane = new Plane().setFromNormalAndCoplanarPoint(normal, hit.point);
    const point = this.actual[body]!.worldToLocal(hit.point.clone());
    this.held = { body, point, plane, goal: hit.point.clone() };
    this.repeating = setInterval(() => this.push(), PUSH_INTERVAL);
    this.controls.enabled = false;
    this.renderer.domElement.setPointerCapture(event.pointerId);
  }

  private drag(event: PointerEvent): void {
    if (this.held !== null) this.ray(event).ray.intersectPlane(this.held.plane, this.held.goal);
  }

  /** Pull the held point towards the pointer. */
  private push(): void {
    if (this.held === null) return;
    const { body, point, goal } = this.held;
    const from = this.actual[body]!.localToWorld(point.clone());
    const force = goal.clone().sub(from).multiplyScalar(STIFFNESS).clampLength(0, LARGEST_FORCE);
    this.onPush?.({ body, point: point.toArray(), force: force.toArray() });
  }

  private letGo(): void {
    clearInterval(this.repeating);
    this.held = null;
    this.controls.enabled = true;
  }

  private ray(event: PointerEvent): Raycaster {
    const box = this.renderer.domElement.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * 2 - 1;
    const y = 1 - ((event.clientY - box.top) / box.height) * 2;
    const raycaster = new Raycaster();
    raycaster.setFromCamera(new Vector2(x, y), this.camera);
    return raycaster;
  }
}

function place(groups: Group[], poses: Float32Array): void {
  groups.forEach((group, body) => {
    const at = body * POSE_SIZE;
    group.position.set(poses[at]!, poses[at + 1]!, poses[at + 2]!);
    group.quaternion.set(poses[at + 4]!, poses[at + 5]!, poses[at + 6]!, poses[at + 3]!);
    group.updateMatrixWorld();
  });
}

function contactLines(): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(6 * MAX_CONTACTS), 3));
  geometry.setDrawRange(0, 0);
  const lines = new LineSegments(geometry, new LineBasicMaterial({ color: 0xf97316, depthTest: false }));
  lines.frustumCulled = false;
  return lines;
}
