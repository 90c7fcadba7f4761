// What the page takes of three.js; `make three` bundles it into page/three.module.min.js.

export {
  BufferAttribute, BufferGeometry, Color, ConeGeometry, CylinderGeometry, DirectionalLight,
  DoubleSide, DynamicDrawUsage, Group, HemisphereLight, InstancedMesh, LineBasicMaterial,
  LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, MeshPhysicalMaterial,
  NeutralToneMapping, PCFShadowMap, PMREMGenerator, PerspectiveCamera, Plane, PlaneGeometry,
  Quaternion, Raycaster, SRGBColorSpace, Scene, ShaderMaterial, ShadowMaterial, SphereGeometry,
  Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
export { RoomEnvironment } from "three/examples/jsm/environments/RoomEnvironment.js";
