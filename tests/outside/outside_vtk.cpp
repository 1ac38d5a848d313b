// A user of the VTK adaptor: its header compiles alone, its library links.
#include <insitu/vtk.h>

int main()
{
    insitu_vtk_adaptor *adaptor = nullptr;
    insitu_vtk_destroy(&adaptor);
    return adaptor != nullptr;
}
