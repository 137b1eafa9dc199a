import{n as a,o as b,p as c}from"./chunk-QANRFXIX.js";import"./chunk-D6EXJMUY.js";import"./chunk-BYXBJQAS.js";export{a as Scope,b as useFrames,c as useTheme};
