
// touched
